# SPDX-License-Identifier: BSD-3-Clause
"""A minimal Debian in a folder, made by mmdebstrap and entered by chroot. Needs root."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

SKIPPED = 77


def skip(reason: str) -> None:
    """End without having tested, and say why."""
    print(f"SKIPPED: {reason}.\nNothing was tried on a bare machine.")
    sys.exit(SKIPPED)


def command_inside(tree: Path, *command: str, network: bool = False) -> list[str]:
    """Give the command line that runs a command inside the tree; its mounts end with it."""
    mounts = f"mount -t proc proc {tree}/proc && mount --bind /dev {tree}/dev"
    inside = ["env", "-i", "PATH=/usr/bin:/bin:/usr/sbin:/sbin", "HOME=/root", "LANG=C.UTF-8"]
    script = f'{mounts} && exec chroot {tree} "$@"'
    unshare = ["unshare", "--mount", *([] if network else ["--net"]), "sh", "-c", script, "sh"]
    return [*unshare, *inside, *command]


def enter(tree: Path, *command: str) -> int:
    """Run a command inside the tree, without network."""
    return subprocess.run(command_inside(tree, *command), check=False).returncode


def make_tree(suite: str, tree: Path, packages: str) -> None:
    """Make a minimal tree with some packages, once."""
    if os.geteuid() != 0:
        skip("chroot needs root")
    if not (tree / "complete").exists():
        if shutil.which("mmdebstrap") is None:
            skip("mmdebstrap is missing (apt-get install mmdebstrap)")
        shutil.rmtree(tree, ignore_errors=True)
        mirror = os.environ.get("ORBSLAM2PY_DEBIAN_MIRROR", "http://deb.debian.org/debian")
        options = ["--quiet", "--variant=minbase", f"--include={packages}"]
        command = ["mmdebstrap", *options, suite, str(tree), mirror]
        if subprocess.run(command, check=False).returncode != 0:
            skip(f"mmdebstrap could not make a tree of {suite}")
        (tree / "complete").touch()
    if enter(tree, "true") != 0:
        skip("this machine does not allow mounts and chroot")
