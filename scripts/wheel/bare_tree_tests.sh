#!/bin/sh
# What test_wheel.py runs inside a bare tree, as root: /srv/wheels has the wheel and what it depends on,
# /srv/checkout the Python tests. Nothing is fetched.
set -eu
said() { printf '\n== %s\n' "$*"; }
fails() { printf 'FAILED: %s\n' "$*"; exit 1; }

said "A bare $(. /etc/os-release; echo "$PRETTY_NAME") with $(python3 --version)"
for tool in c++ gcc clang cmake; do
  command -v "$tool" >/dev/null && fails "$tool is there: not a bare tree"
done
export PIP_NO_INDEX=1 PIP_FIND_LINKS=/srv/wheels PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore

said "Installing, without downloads"
rm -rf /opt/venv /srv/runs && mkdir -p /srv/runs
python3 -m venv /opt/venv
start=$(date +%s.%N)
/opt/venv/bin/python -m pip install -q orbslam2py
python3 -c "import sys; print(f'pip install: {float(sys.argv[2]) - float(sys.argv[1]):.1f} s')" "$start" "$(date +%s.%N)"
export PATH=/opt/venv/bin:$PATH
cd /srv/runs

said "The demonstration"
orbslam2py demo --output demo >demo.log 2>&1 || { tail -20 demo.log; fails "the demo"; }
test -s demo/trajectory.txt || fails "the demo left no trajectory"
tail -3 demo.log

said "A sequence, deterministic, twice, in a path with a space and other letters, not in UTF-8"
mkdir -p "Ordner mit Ä 日本"
(
  cd "Ordner mit Ä 日本"
  export LC_ALL=C PYTHONUTF8=0 PYTHONCOERCECLOCALE=0
  orbslam2py synthesize corridor --world corridor --sensor stereo --frames 40 --size 320x240 >log 2>&1
  for run in one two; do
    orbslam2py run corridor --sensor stereo --deterministic --output "$run" >>log 2>&1 || { tail log; exit 1; }
  done
  cmp one/trajectory.txt two/trajectory.txt
) || fails "the sequence"
cp "Ordner mit Ä 日本/one/trajectory.txt" stereo.txt
wc -l stereo.txt

said "A user who can write neither to a home nor to site-packages"
mkdir -p nobody && chown nobody nobody
(
  cd nobody
  HOME=/nonexistent setpriv --reuid=nobody --regid=nogroup --clear-groups \
    orbslam2py run "../Ordner mit Ä 日本/corridor" --sensor stereo --deterministic --output run >log 2>&1 ||
    { tail -20 log; exit 1; }
  cmp run/trajectory.txt ../stereo.txt
) || fails "without a home"

said "Beside another OpenCV in one process"
for name in $(cat /srv/wheels/opencv.txt); do
  target=/opt/cv/$name
  rm -rf "$target"
  python -m pip install -q --no-deps --target "$target" "$name" || fails "installing $name"
  for first in cv2 orbslam2py; do
    PYTHONPATH=$target python /srv/checkout/scripts/wheel/beside_opencv.py "$first" "$target" || fails "$name, $first first"
  done
done

said "Tests that need no build"
python -m pip install -q pytest pytest-benchmark pytest-xdist hypothesis scipy rosbags
cd /srv/checkout
python -m pytest -q -p no:cacheprovider -m "not shared" tests/python/core tests/python/settings \
  tests/python/trajectory tests/python/vocabulary tests/python/evaluation
said "The wheel works here."
