# SPDX-License-Identifier: BSD-3-Clause
"""Loads the compiled part of the package, and explains failures."""

from __future__ import annotations

import importlib
import platform
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import ModuleType

#: The module.
NAME = "orbslam2py._core"

#: What x86-64-v2 asks of a processor, by the names of /proc/cpuinfo.
_INSTRUCTIONS = {
    "pni": "SSE3",
    "ssse3": "SSSE3",
    "sse4_1": "SSE4.1",
    "sse4_2": "SSE4.2",
    "popcnt": "POPCNT",
    "cx16": "CMPXCHG16B",
    "lahf_lm": "LAHF",
}

_REMEDY = (
    "Install a wheel for this Python and machine, or build from source: README.md says how, under "
    "Install."
)


def missing_instructions(cpuinfo: str) -> list[str]:
    """Return the instructions that the compiled part needs and a processor does not have.

    Parameters
    ----------
    cpuinfo
        The text of /proc/cpuinfo. Without a line of flags, none is reported as missing.
    """
    for line in cpuinfo.splitlines():
        key, _, value = line.partition(":")
        if key.strip() == "flags":
            there = set(value.split())
            return [name for flag, name in _INSTRUCTIONS.items() if flag not in there]
    return []


def _first_processor() -> str:
    """Return the description of the first processor in /proc/cpuinfo; empty on other systems."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as lines:
            text = ""
            for line in lines:
                text += line
                if not line.strip():
                    break
            return text
    except OSError:
        return ""


def load() -> ModuleType:
    """Load the compiled part.

    Raises
    ------
    ImportError
        The message says what is missing: instructions of the processor, a module for this Python
        and this machine, or a library of the system.
    KeyboardInterrupt
        On Ctrl-C, also if it interrupted the loading.
    """
    machine = platform.machine()
    if machine in ("x86_64", "AMD64") and (lacking := missing_instructions(_first_processor())):
        # Loading it would end the program by an illegal instruction.
        raise ImportError(
            f"This processor lacks {', '.join(lacking)}, which orbslam2py uses (x86-64-v2).\n"
            "Use a machine with a processor of 2009 or later, or configure the virtual machine "
            "to use its host's processor.",
            name=NAME,
        )
    try:
        return importlib.import_module(NAME)
    except ImportError as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            # Ctrl-C during loading, which pybind11 reports as a failure to load.
            raise KeyboardInterrupt from error
        folder = Path(__file__).parent
        names = sorted(path.name for path in folder.glob("_core.*.so"))
        python = f"{sys.implementation.name} {sys.version_info.major}.{sys.version_info.minor}"
        if any((folder / f"_core{suffix}").exists() for suffix in EXTENSION_SUFFIXES):
            message = f"The compiled part of orbslam2py cannot be loaded: {error}.\n{_REMEDY}"
        else:
            there = f"there is {', '.join(names)}" if names else "there is none at all"
            message = (
                f"The compiled part of orbslam2py is missing for {python} on {machine}: {there}.\n"
                f"{_REMEDY}"
            )
        raise ImportError(message, name=NAME) from error
