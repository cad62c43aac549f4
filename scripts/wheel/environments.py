# SPDX-License-Identifier: BSD-3-Clause
"""The versions of its dependencies that a wheel is tried with."""

from __future__ import annotations

import re
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

PROJECT = Path(__file__).resolve().parents[2]

#: Where the oldest version that pyproject.toml allows has no wheel for a Python, or one that does
#: not go with the others: the oldest that does.
OLDEST_WHEELS = {
    "3.11": {"pillow": "9.3"},
    "3.13": {
        "numpy": "2.1",
        "opencv-python-headless": "4.10.0.84",
        "matplotlib": "3.9.2",
        "pillow": "11.0",
        "pyyaml": "6.0.2",
    },
}


def oldest(python: str) -> list[str]:
    """Give the oldest allowed version of every dependency, as constraints for pip."""
    pyproject = tomllib.loads((PROJECT / "pyproject.toml").read_text())
    constraints = []
    for dependency in pyproject["project"]["dependencies"]:
        match = re.fullmatch(r"([\w.-]+)>=([\d.]+)", dependency)
        if match is None:
            raise ValueError(f"{dependency} in pyproject.toml has no lower bound")
        name, bound = match.groups()
        version = OLDEST_WHEELS[python].get(name, bound)
        # Of OpenCV's packages a version has a fourth number that counts the builds.
        builds = ".*" if name.startswith("opencv") and version.count(".") < 3 else ""
        constraints.append(f"{name}=={version}{builds}")
    return constraints


def environments(python: str) -> dict[str, list[str]]:
    """Give the constraints of each environment for a version of Python."""
    made = {"newest": [], "oldest": oldest(python)}
    if python == "3.11":  # numpy 1 has no wheels for a Python after 3.12
        made["numpy-1.26"] = ["numpy==1.26.4"]
    return made
