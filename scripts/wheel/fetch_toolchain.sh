#!/bin/sh
# fetch_toolchain.sh FOLDER: unpacks the compiler and the C library of Debian 11 into FOLDER. Nothing is
# installed and nothing is run there: programs of an older Debian work on a younger one.
# Needs mmdebstrap (Debian's package) and reaches Debian's mirror.
set -eu
folder=$1
suite=${ORBSLAM2PY_WHEEL_SUITE:-bullseye}
gcc=${ORBSLAM2PY_WHEEL_GCC:-10}
packages="g++-$gcc,libc6-dev,libdeflate-dev,zlib1g-dev"
[ "$(cat "$folder/complete" 2>/dev/null)" = "$packages" ] && exit 0
command -v mmdebstrap >/dev/null || {
  echo "mmdebstrap is missing: apt-get install mmdebstrap" >&2
  exit 1
}
rm -rf "$folder"
mkdir -p "$(dirname "$folder")"
mmdebstrap --quiet --variant=extract --include="$packages" "$suite" "$folder" \
  "${ORBSLAM2PY_DEBIAN_MIRROR:-http://deb.debian.org/debian}"
# Links from the root would lead out of the folder.
find "$folder" -type l -lname '/*' | while read -r link; do
  ln -sfn "$(realpath --canonicalize-missing --relative-to "$(dirname "$link")" "$folder$(readlink "$link")")" "$link"
done
echo "$packages" >"$folder/complete"
