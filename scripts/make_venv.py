# SPDX-License-Identifier: BSD-3-Clause
"""Make the virtual environment of the checkout, or make it anew where it does not work.

``python3 scripts/make_venv.py .venv``: with the Python that runs it. One that works is left alone.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

from steps import LOGS, OLDEST_PYTHON, PROJECT, FailedError, Step, main, run, stop

#: Compiled for the Python of the environment, so it goes with it.
EXTENSIONS = PROJECT / "build/python"

QUESTION = "import sys, pip; print('%d.%d' % sys.version_info[:2])"


def check_python() -> None:
    """End with a message if this Python is too old."""
    if sys.version_info < OLDEST_PYTHON:
        oldest = ".".join(map(str, OLDEST_PYTHON))
        stop(
            f"orbslam2py needs Python {oldest} or later; {sys.executable} is "
            f"{sys.version.split()[0]}.\n"
            f"If a later one is installed, name it: make demo PYTHON=python3.11"
        )


def fault(folder: Path, wanted: str | None = None) -> str | None:
    """Say what is wrong with a virtual environment; None if it works and has the wanted version."""
    try:
        command = [str(folder / "bin/python"), "-c", QUESTION]
        answer = subprocess.run(command, capture_output=True, check=True, text=True)
        pip = (folder / "bin/pip").read_text(errors="replace")
    except (OSError, subprocess.CalledProcessError):
        return "has no Python that runs, or no pip"
    version = answer.stdout.strip()
    made_for = _version_of_settings((folder / "pyvenv.cfg").read_text())
    if made_for != version:
        return f"was made for Python {made_for}, and its Python is {version} now"
    if wanted is not None and version != wanted:
        return f"has Python {version}, and you named Python {wanted}"
    if tuple(map(int, version.split("."))) < OLDEST_PYTHON:
        return f"was made with Python {version}, which is too old"
    interpreter = Path(pip.partition("\n")[0][2:].strip())
    if (
        interpreter.name.startswith("python")
        and interpreter.parent.parent.resolve() != folder.resolve()
    ):
        return f"was made at another place, {interpreter.parent.parent}"
    return None


def _version_of_settings(settings: str) -> str:
    """Give the version, as 3.11, that is written into pyvenv.cfg."""
    match = re.search(r"^version(?:_info)?\s*=\s*(\d+\.\d+)", settings, re.MULTILINE)
    return match[1] if match else "?"


def make(folder: Path) -> None:
    """Make it with this Python."""
    step = Step([sys.executable, "-m", "venv", "--clear", str(folder)], LOGS / "venv.log", nothing)
    try:
        run(f"Making a virtual environment in {folder}", step)
    except FailedError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    shutil.rmtree(EXTENSIONS, ignore_errors=True)


def nothing(line: str) -> None:
    """Say nothing about how far it is."""


def start() -> None:
    """Check Python and the environment."""
    parser = argparse.ArgumentParser(description="Make the virtual environment of the checkout.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only-check-python", action="store_true")
    parser.add_argument("--this-python", action="store_true", help="no other version will do")
    arguments = parser.parse_args()
    check_python()
    if arguments.only_check_python:
        return
    folder = arguments.folder
    if folder.exists() and any(folder.iterdir()):
        if not (folder / "pyvenv.cfg").exists():
            stop(
                f"{folder} is not a virtual environment: it has no pyvenv.cfg. "
                "It is left as it is. Move it away, then try again."
            )
        this = ".".join(map(str, sys.version_info[:2]))
        wrong = fault(folder, this if arguments.this_python else None)
        if wrong is None:
            return
        print(
            f"{folder} {wrong}. It is made anew; what you installed into it besides has to be "
            "installed again."
        )
    make(folder)


if __name__ == "__main__":
    main(start)
