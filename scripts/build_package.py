# SPDX-License-Identifier: BSD-3-Clause
"""Build the package and install it for development, with what it needs to run.

Python files are used from src, extensions are compiled in build/python. The compiler works longest,
so Python packages are installed meanwhile.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from install_requirements import pip_step
from steps import LOGS, Step, main, ninja_position, run

#: What the compiler needs for the largest source.
GIGABYTES = 1.3


def jobs() -> int:
    """Give how many sources are compiled at the same time: memory must be enough for them."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    free = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
    return max(1, min(len(os.sched_getaffinity(0)) + 1, int(free / (GIGABYTES * 1e9))))


def start() -> None:
    """Build and install."""
    parser = argparse.ArgumentParser(description="Build the package, install it for development.")
    parser.add_argument("--jobs", type=int, help="sources compiled at the same time")
    count = parser.parse_args().jobs or jobs()
    pip = [sys.executable, "-m", "pip", "install", "--verbose", "--disable-pip-version-check"]
    options = ["--no-build-isolation", "--no-deps"]
    environment = {
        # Of scikit-build-core; as options of pip they need pip 23.1, which Debian 12 does not have.
        "SKBUILD_BUILD_DIR": "build/python",
        "SKBUILD_EDITABLE_MODE": "redirect",
        "SKBUILD_CMAKE_DEFINE": "ORBSLAM2PY_WERROR=ON",
        # The name that CMake gives the compiler elsewhere: the compiler cache tells names apart.
        "CXX": os.environ.get("CXX") or "c++",
        "CMAKE_BUILD_PARALLEL_LEVEL": str(count),
    }
    build = Step([*pip, *options, "-e", "."], LOGS / "build.log", ninja_position, environment)
    run("Compiling the package", build, pip_step("demo")._replace(name="Python packages"))


if __name__ == "__main__":
    main(start)
