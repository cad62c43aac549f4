#!/bin/sh
# fetch_libraries.sh FOLDER: unpacks Debian's arm64 libraries that the core needs into FOLDER. Nothing is
# installed: programs for arm64 are linked with them, and run with them by qemu-user.
# Needs mmdebstrap (Debian's package) and reaches Debian's mirror.
set -eu
folder=$1
packages=libc6-dev,libstdc++-12-dev,libopencv-core-dev,libopencv-imgproc-dev,libeigen3-dev,libhwy-dev,libdeflate-dev,libgmock-dev
[ "$(cat "$folder/complete" 2>/dev/null)" = "$packages" ] && exit 0
command -v mmdebstrap >/dev/null || {
  echo "mmdebstrap is missing: apt-get install mmdebstrap" >&2
  exit 1
}
rm -rf "$folder"
mkdir -p "$(dirname "$folder")"
mmdebstrap --quiet --variant=extract --architectures=arm64 \
  --include="$packages" \
  bookworm "$folder" "${ORBSLAM2PY_DEBIAN_MIRROR:-http://deb.debian.org/debian}"
# Links from the root would lead out of the folder; others are made by packages' scripts, which were not run.
find "$folder" -type l -lname '/*' | while read -r link; do
  ln -sfn "$(realpath --canonicalize-missing --relative-to "$(dirname "$link")" "$folder$(readlink "$link")")" "$link"
done
for library in blas lapack; do # OpenCV's
  for name in "lib$library.so" "lib$library.so.3"; do
    ln -sf "$library/lib$library.so.3" "$folder/usr/lib/aarch64-linux-gnu/$name"
  done
done
echo "$packages" >"$folder/complete"
