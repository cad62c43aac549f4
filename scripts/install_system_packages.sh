#!/bin/sh
# Installs the Debian packages of system_packages.txt that are missing; asks for root rights only
# if something has to be installed.
set -eu
list="$(dirname "$0")/system_packages.txt"
packages=$(sed -e 's/#.*//' "$list")
missing=""
for package in $packages; do
  state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$state" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

run=""
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || {
    echo "These Debian packages are missing:$missing" >&2
    echo "Install them as root (apt-get install$missing), then try again." >&2
    exit 1
  }
  run=sudo
fi
echo "Installing system packages:$missing"
$run apt-get update -qq
# shellcheck disable=SC2086  # the list is meant to be split
DEBIAN_FRONTEND=noninteractive $run apt-get install -y -qq --no-install-recommends $missing >/dev/null
