#!/bin/sh
# What test_wheel.py runs inside a bare tree, as root: /srv/wheels has the wheel and what it depends on,
# a folder for each choice of versions, /srv/checkout the Python tests. Nothing is fetched.
set -eu
said() { printf '\n== %s\n' "$*"; }
fails() { printf 'FAILED: %s\n' "$*"; exit 1; }

said "A bare $(. /etc/os-release; echo "$PRETTY_NAME") with $(python3 --version)"
for tool in c++ gcc clang cmake; do
  command -v "$tool" >/dev/null && fails "$tool is there: not a bare tree"
done
export PIP_NO_INDEX=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore
system_path=$PATH
rm -rf /opt/* /srv/runs
mkdir -p /srv/runs
cd /srv/runs

# install_into ENVIRONMENT: as a user does, into a new environment, which is then the one in use
install_into() {
  export PIP_FIND_LINKS=/srv/wheels/$1 PATH=$system_path
  python3 -m venv "/opt/$1"
  start=$(date +%s.%N)
  "/opt/$1/bin/python" -m pip install -q -c "/srv/wheels/$1/constraints.txt" orbslam2py
  python3 -c "import sys; print(f'pip install: {float(sys.argv[2]) - float(sys.argv[1]):.1f} s')" "$start" "$(date +%s.%N)"
  export PATH=/opt/$1/bin:$system_path
  python -m pip list --format=freeze | grep -iE '^(numpy|opencv|typer|rich|matplotlib|pillow|pyyaml|lazy.loader)' | xargs
}

# demonstration FOLDER [OPTION...]
demonstration() {
  orbslam2py demo --output "$@" >"$1.log" 2>&1 || { tail -20 "$1.log"; fails "the demo"; }
  test -s "$1/trajectory.txt" || fails "the demo left no trajectory"
}

# tests_without_build: those of the checkout that need nothing but the installed package
tests_without_build() {
  python -m pip install -q -c "$PIP_FIND_LINKS/constraints.txt" pytest pytest-benchmark pytest-xdist hypothesis scipy rosbags
  (
    cd /srv/checkout
    python -m pytest -q -p no:cacheprovider -m "not shared and not slow" tests/python/core tests/python/settings \
      tests/python/trajectory tests/python/vocabulary tests/python/evaluation \
      tests/python/calibration tests/python/datasets tests/python/recordings \
      --ignore=tests/python/trajectory/test_files.py --ignore=tests/python/evaluation/test_metrics.py # need evo
  ) || fails "the tests"
}

said "Installing, without downloads"
install_into newest

said "The demonstration"
demonstration demo
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
sha256sum stereo.txt

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
  python -m pip install -q --no-deps --find-links /srv/wheels/opencv --target "$target" "$name" || fails "installing $name"
  for first in cv2 orbslam2py; do
    PYTHONPATH=$target python /srv/checkout/scripts/wheel/beside_opencv.py "$first" "$target" || fails "$name, $first first"
  done
done

said "Tests that need no build"
tests_without_build

for environment in $(cat /srv/wheels/environments.txt); do
  [ "$environment" = newest ] && continue
  said "With other versions of what it depends on: $environment"
  install_into "$environment"
  for command in "" run evaluate synthesize settings vocabulary; do
    orbslam2py $command --help >help.log 2>&1 || { tail -5 help.log; fails "the help of $command"; }
  done
  demonstration "demo-$environment" --frames 40
  orbslam2py run "Ordner mit Ä 日本/corridor" --sensor stereo --deterministic --output "run-$environment" >run.log 2>&1 ||
    { tail -20 run.log; fails "the sequence"; }
  cmp "run-$environment/trajectory.txt" stereo.txt || fails "another path than with the newest versions"
  tests_without_build
done
said "The wheel works here."
