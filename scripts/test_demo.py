# SPDX-License-Identifier: BSD-3-Clause
"""Run `make demo` on a bare machine: a minimal Debian with git, make, a compiler and Python.

``test_demo.py --suite bookworm`` makes the tree, copies the checkout into it and runs `make demo`
there, with network: from nothing, again, and after the checkout was moved. Where the machine does
not allow it, it says so and ends with 77.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from bare_tree import command_inside, make_tree
from install_system_packages import DEFAULT_SECTION, LIST, sections

PROJECT = Path(__file__).resolve().parent.parent
PACKAGES = "git,make,g++,python3,ca-certificates"
CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"
#: Settings of this machine's way into the network.
PASSED_ON = ("http_proxy", "https_proxy", "no_proxy", "PIP_INDEX_URL", "PIP_CERT")
CHECKOUT = "srv/checkout"
MOVED = "srv/moved"
#: Seconds without a line that somebody who waits may have to bear.
LONGEST_SILENCE = 30.0


def copy_checkout(target: Path) -> None:
    """Copy the files that git knows or does not ignore."""
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    answer = subprocess.run(listing, cwd=PROJECT, stdout=subprocess.PIPE, check=True)
    for name in answer.stdout.decode().split("\0"):
        if name and (PROJECT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(PROJECT / name, target / name)


def run(tree: Path, *command: str) -> str:
    """Run a command inside, pass its output on; end if it fails or is silent too long."""
    passed = [f"{name}={os.environ[name]}" for name in PASSED_ON if name in os.environ]
    line = command_inside(tree, "env", *passed, *command, network=True)
    began = last = time.monotonic()
    lines, silence = [], 0.0
    with subprocess.Popen(
        line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8"
    ) as process:
        assert process.stdout is not None
        for text in process.stdout:
            now = time.monotonic()
            silence, last = max(silence, now - last), now
            print(f"{now - began:6.1f} {text}", end="", flush=True)
            lines.append(text)
    seconds = time.monotonic() - began
    print(f"{' '.join(command)}: {seconds:.0f} s, never silent for more than {silence:.0f} s")
    if process.returncode != 0:
        sys.exit(f"FAILED: {' '.join(command)} ended with {process.returncode}")
    if silence > LONGEST_SILENCE:
        sys.exit(f"FAILED: nothing was printed for {silence:.0f} s")
    return "".join(lines)


def expect(true: bool, what: str) -> None:
    """End the program if something is not as it should be."""
    if not true:
        sys.exit(f"FAILED: {what}")


def main() -> None:
    """Test the demo in a bare tree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--suite", default="bookworm")
    parser.add_argument("--folder", type=Path, default=PROJECT / "build/demo")
    arguments = parser.parse_args()
    kept = arguments.folder.resolve() / f"bare-{arguments.suite}"
    make_tree(arguments.suite, kept, PACKAGES)
    tree = arguments.folder.resolve() / f"tried-{arguments.suite}"
    shutil.rmtree(tree, ignore_errors=True)
    subprocess.run(["cp", "-a", kept, tree], check=True)
    for name in ("/etc/resolv.conf", "/etc/hosts", CERTIFICATES):
        shutil.copy(name, tree / name[1:])
    copy_checkout(tree / CHECKOUT)

    run(tree, "make", "-C", f"/{CHECKOUT}", "demo")
    for name in ("trajectory.png", "report.html", "report.json"):
        expect((tree / CHECKOUT / "runs/demo" / name).exists(), f"runs/demo/{name} is missing")
    installed = run(tree, "dpkg-query", "-W", "-f=${Package}\\n").split()
    known = sections(LIST.read_text())
    others = {package for names in known.values() for package in names}
    needless = others.intersection(installed) - set(known[DEFAULT_SECTION])
    expect(not needless, f"{needless} are not needed for the demo")

    again = run(tree, "make", "-C", f"/{CHECKOUT}", "demo")
    for word in ("Installing", "Compiling"):
        expect(word not in again, f"the second run says {word}")

    (tree / CHECKOUT).rename(tree / MOVED)
    moved = run(tree, "make", "-C", f"/{MOVED}", "demo")
    expect("was made at another place" in moved, "a moved checkout was not noticed")
    print("The demo runs on a bare machine.")


if __name__ == "__main__":
    main()
