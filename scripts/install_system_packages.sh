#!/bin/sh
# install_system_packages.sh [SECTION...]: installs the Debian packages of system_packages.txt that are
# missing; without a section, those that the package is built with.
set -eu
command -v python3 >/dev/null || {
  echo "python3 is missing. Install Python 3.10 or later (on Debian: apt-get install python3), then try again." >&2
  exit 1
}
exec python3 "$(dirname "$0")/install_system_packages.py" "$@"
