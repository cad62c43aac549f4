# SPDX-License-Identifier: BSD-3-Clause
"""Processor time that building from nothing takes, without the compiler cache."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pybind11

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

CHECKOUT = Path(__file__).resolve().parents[2]
PARTS = ("package", "tests")
#: Processor minutes of the package; the tests may take so many times that.
GOAL, TIMES = 4.0, 1.5


@dataclass(frozen=True)
class Built:
    """Resources of one build."""

    minutes: float
    slowest: list[tuple[float, str]]  #: seconds on the clock and file, longest first


def processor_seconds() -> float:
    """Time of all child processes that have ended, as user and in the kernel."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def configuration(part: str, source: Path) -> tuple[list[str], list[str]]:
    """Words for CMake that configure a part, and its targets."""
    if part == "tests":
        return ["--preset", "release"], []
    settings = tomllib.loads((source / "pyproject.toml").read_text())["tool"]["scikit-build"]
    defines = settings["cmake"]["define"] | {
        "CMAKE_BUILD_TYPE": settings["cmake"]["build-type"],
        "Python_EXECUTABLE": sys.executable,
        "pybind11_DIR": pybind11.get_cmake_dir(),
    }
    return [f"-D{name}={value}" for name, value in defines.items()], settings["build"]["targets"]


def build(part: str, source: Path, folder: Path, jobs: int) -> Built:
    """Configure and compile a part from nothing."""
    words, targets = configuration(part, source)
    environment = os.environ | {"CCACHE_DISABLE": "1", "CMAKE_GENERATOR": "Ninja"}
    configure = ["cmake", "-S", ".", "-B", folder, *words]
    compile_all = ["cmake", "--build", folder, "-j", str(jobs)]
    compile_all += [word for target in targets for word in ("--target", target)]
    begin = processor_seconds()
    for command in (configure, compile_all):
        subprocess.run(command, cwd=source, env=environment, check=True, stdout=subprocess.DEVNULL)
    minutes = (processor_seconds() - begin) / 60
    rows = (line.split("\t") for line in (folder / ".ninja_log").read_text().splitlines()[1:])
    times = {row[3]: (int(row[1]) - int(row[0])) / 1000 for row in rows}
    slowest = sorted(((seconds, name) for name, seconds in times.items()), reverse=True)
    return Built(minutes, slowest)


def unpack(commit: str, folder: Path) -> Path:
    """Write the files of a commit into a folder."""
    archive = folder / "before.tar"
    subprocess.run(["git", "archive", "-o", archive, commit], cwd=CHECKOUT, check=True)
    source = folder / "before"
    source.mkdir()
    subprocess.run(["tar", "xf", archive, "-C", source], check=True)
    return source
