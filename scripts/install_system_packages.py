# SPDX-License-Identifier: BSD-3-Clause
"""Install the Debian packages of system_packages.txt that are missing.

Called by install_system_packages.sh. Asks for root rights only if something has to be installed,
and waits for other programs that install packages.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import time
from pathlib import Path

from steps import LOGS, Display, Step, apt_position, failure, follow, main, stop

LIST = Path(__file__).with_name("system_packages.txt")
DEFAULT_SECTION = "package"

#: Seconds: between two tries while another program holds a lock, and until we give up.
TRY_AGAIN = 2.0
PATIENCE = 1800.0

_LOCKED = re.compile(
    r"Could not get lock \S+( It is held by process (?P<id>\d+)( \((?P<name>.*?)\))?)?"
    r"|Unable to (?:lock|acquire)|frontend lock was locked by another process",
    re.MULTILINE,
)


def sections(text: str) -> dict[str, list[str]]:
    """Give the packages of each section of the list."""
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        content = line.partition("#")[0].strip()
        if content.startswith("["):
            current = found.setdefault(content.strip("[]"), [])
        elif content:
            current.append(content)
    return found


def missing(packages: list[str]) -> list[str]:
    """Give the packages that are not installed."""
    query = ["dpkg-query", "-W", "-f=${Package} ${db:Status-Status}\\n", *packages]
    answer = subprocess.run(query, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)
    installed = {
        line.split()[0]
        for line in answer.stdout.decode().splitlines()
        if line.endswith(" installed")
    }
    return [package for package in packages if package not in installed]


def root_prefix(packages: list[str]) -> list[str]:
    """Give what is put before a command that needs root rights."""
    if os.geteuid() == 0:
        return []
    remedy = (
        f"Install them as root (apt-get install {' '.join(packages)}), then try again.\n"
        f"These Debian packages are missing: {' '.join(packages)}"
    )
    if shutil.which("sudo") is None:
        stop(f"Debian packages are missing, you are not root and there is no sudo.\n{remedy}")
    known = subprocess.run(["sudo", "-n", "true"], stderr=subprocess.DEVNULL, check=False)
    if known.returncode != 0:
        print("Debian packages are missing; to install them sudo asks for your password.")
        if subprocess.run(["sudo", "-v"], check=False).returncode != 0:
            stop(f"Debian packages are missing, and sudo gave no root rights.\n{remedy}")
    return ["sudo"]


def lock_holder(output: str) -> str | None:
    """Give who holds a lock of the package manager, if apt-get failed because of one."""
    match = _LOCKED.search(output)
    if match is None or "Permission denied" in output:
        return None
    if match["id"] is None:
        return "another program"
    return f"process {match['id']}" + (f" ({match['name']})" if match["name"] else "")


def apt_get(display: Display, prefix: list[str], *arguments: str) -> int:
    """Run apt-get, again and again while another program holds a lock; gives the exit code."""
    # Its progress goes to a descriptor of its own: with that of the output, packages' scripts fail.
    # A shell makes it, as sudo closes those that it is given.
    command = [*prefix, "env", "DEBIAN_FRONTEND=noninteractive", "LC_ALL=C"]
    command += ["sh", "-c", 'exec apt-get "$@" 3>&1', "apt-get", "-o", "APT::Status-Fd=3"]
    # apt-get itself waits for one of its three locks, and only if it is asked to.
    command += ["-o", "DPkg::Lock::Timeout=0", "-y", *arguments]
    step = Step(command, log_of(arguments[0]), apt_position)
    give_up = time.monotonic() + PATIENCE
    said = None
    while True:
        (code,) = follow(display, step)
        holder = lock_holder(step.log.read_text(errors="replace")) if code != 0 else None
        if holder is None or time.monotonic() > give_up:
            return code
        waits = f"waits for {holder}, which uses the package manager"
        if holder != said:
            display.show(waits)
        said = holder
        display.update(waits)
        time.sleep(TRY_AGAIN)


def log_of(action: str) -> Path:
    """Give where the output of an action of apt-get goes."""
    return LOGS / f"apt-get-{action}.log"


def install(packages: list[str]) -> None:
    """Install packages."""
    prefix = root_prefix(packages)
    print(f"Debian packages that are missing: {' '.join(packages)}", flush=True)
    display = Display("Reading the list of Debian's packages")
    # Another source of the system may be broken, and ours good.
    updated = apt_get(display, prefix, "update") == 0
    if updated:
        display.done()
    else:
        display.show(f"failed; see {log_of('update')}. Trying with the list of before")
        display.leave()
    doing = "Installing Debian packages"
    display = Display(doing)
    if apt_get(display, prefix, "install", "--no-install-recommends", *packages) != 0:
        display.leave()
        hint = f"Or install them yourself, as root: apt-get install {' '.join(packages)}"
        if not updated:
            hint = f"{failure('apt-get update', log_of('update'))}\n{hint}"
        raise failure(doing, log_of("install"), hint)
    display.done()


def start() -> None:
    """Install what is missing."""
    known = sections(LIST.read_text())
    parser = argparse.ArgumentParser(description="Install Debian packages that are missing.")
    parser.add_argument(
        "sections", nargs="*", metavar="SECTION", help=f"{', '.join(known)} [{DEFAULT_SECTION}]"
    )
    chosen = parser.parse_args().sections or [DEFAULT_SECTION]
    for section in chosen:
        if section not in known:
            parser.error(f"{LIST.name} has no section {section}; it has {', '.join(known)}")
    if os.environ.get("SYSTEM_PACKAGES") == "skip":
        return
    wanted = list(dict.fromkeys(package for section in chosen for package in known[section]))
    if shutil.which("dpkg-query") is None or shutil.which("apt-get") is None:
        stop(
            "This system does not have Debian's package manager. Needed is what these packages of "
            f"Debian 12 hold: {' '.join(wanted)}\n"
            "Install that in this system's way, then add SYSTEM_PACKAGES=skip to the command: "
            "make demo SYSTEM_PACKAGES=skip"
        )
    packages = missing(wanted)
    if packages:
        install(packages)


if __name__ == "__main__":
    main(start)
