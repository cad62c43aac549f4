#!/bin/sh
# test_arm.sh FOLDER JOBS [all]: builds the core and its tests for arm64 in FOLDER and runs them by qemu-user:
# without those of slow_tests.txt, or all. Then the sequence of sequence_driver, here and there, each with Ceres as the
# wheel has it: the same bytes.
set -eu
cd "$(dirname "$0")/../.."
folder=$1 jobs=$2 which=${3:-chosen}
emulator=$(command -v qemu-aarch64 || command -v qemu-aarch64-static)

scripts/arm/fetch_libraries.sh "$folder/sysroot"
ORBSLAM2PY_SYSROOT=$(realpath "$folder/sysroot")
export ORBSLAM2PY_SYSROOT
# Debian's Ceres is compiled with fused multiply-add for arm64, and asks another sparse solver than the wheel's.
ceres() { # ceres FOLDER PROCESSOR [OPTION...]: the wheel's, for a processor
  built=$1 processor=$2
  shift 2
  "${PYTHON:-python3}" scripts/wheel/build_libraries.py "$built" --only ceres --processor "$processor" --jobs "$jobs" "$@"
}
ceres "$folder" aarch64 --toolchain scripts/arm/toolchain.cmake
build=$folder/tests
# More optimisation takes the compiler longer than it saves the emulator.
cmake -S . -B "$build" -G Ninja -DCMAKE_TOOLCHAIN_FILE="$PWD/scripts/arm/toolchain.cmake" \
  -DCeres_DIR="$(realpath "$folder/libraries/lib/cmake/Ceres")" -DCMAKE_DISABLE_FIND_PACKAGE_OpenMP=ON \
  -DCMAKE_CXX_FLAGS_RELEASE="-O1 -DNDEBUG" -DORBSLAM2PY_TESTS=ON -DORBSLAM2PY_UNITY=ON \
  >"$folder/configure.log" || { cat "$folder/configure.log"; exit 1; }
cmake --build "$build" -j "$jobs"

left_out=""
if [ "$which" != all ]; then
  left_out=$(sed -e 's/#.*//' -e 's/[[:space:]]*$//' -e '/^$/d' scripts/arm/slow_tests.txt | paste -sd:)
fi
# Whole programs, not test by test as ctest does: it takes the emulator longer to load one than to run most tests.
export ORBSLAM2PY_SHARED=/nonexistent # real sequences would take hours
find "$build/tests/cpp" -maxdepth 1 -name 'test_*' -type f -perm -u+x | sort |
  xargs -P "$jobs" -I PROGRAM scripts/arm/run_tests.sh "$emulator" PROGRAM "$left_out"

mkdir -p "$folder/here"
ln -sfn ../sources "$folder/here/sources"
ceres "$folder/here" "$(uname -m)" --native
cmake -S . -B "$folder/here/driver" -G Ninja -DORBSLAM2PY_TESTS=ON -DORBSLAM2PY_UNITY=ON \
  -DCeres_DIR="$(realpath "$folder/here/libraries/lib/cmake/Ceres")" -DCMAKE_DISABLE_FIND_PACKAGE_OpenMP=ON \
  >"$folder/here.log" || { cat "$folder/here.log"; exit 1; }
cmake --build "$folder/here/driver" -j "$jobs" --target sequence_driver
echo "The sequence on $(uname -m):"
"$folder/here/driver/tests/cpp/sequence_driver" --write "$folder/here.txt"
echo "The sequence on aarch64, beside it:"
"$emulator" -L "$ORBSLAM2PY_SYSROOT" "$build/tests/cpp/sequence_driver" --compare "$folder/here.txt"
