#!/bin/sh
# run_tests.sh EMULATOR PROGRAM LEFT_OUT: runs a test program for arm64 without the tests of a list. Tells how
# it went, and all it said if it failed.
set -eu
name=$(basename "$2")
log=$2.log
start=$(date +%s)
status=0
"$1" -L "$ORBSLAM2PY_SYSROOT" "$2" --gtest_brief=1 --gtest_filter="-$3" >"$log" 2>&1 || status=$?
[ "$status" -eq 0 ] || cat "$log"
echo "$name: $(sed -n 's/^\[=*\] //p' "$log" | tail -1) $(grep -c SKIPPED "$log") lines on skipped ones. $(($(date +%s) - start)) s"
[ "$status" -eq 0 ] || { echo "$name FAILED"; exit 1; }
