# SPDX-License-Identifier: BSD-3-Clause
"""Install Python packages that pyproject.toml names, for the Python that runs this.

``install_requirements.py build``: to build the package; ``demo``: to run it; ``developer``: to
build it, to run it with all extras, to test and to document it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from steps import LOGS, PROJECT, Step, main, pip_position, run

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

#: Extras that the demo has: its last line names --viewer.
DEMO_EXTRAS = ("viewer",)
#: Extras that developers install themselves: a wheel of 96 MB, whose tests are skipped without it.
LARGE_EXTRAS = ("oak",)


def requirements(purpose: str, pyproject: Path = PROJECT / "pyproject.toml") -> list[str]:
    """Give the packages for "build", "demo" or "developer"."""
    named = tomllib.loads(pyproject.read_text())
    build, project = named["build-system"]["requires"], named["project"]
    extras = project["optional-dependencies"]
    if purpose == "build":
        return list(build)
    if purpose == "demo":
        return [*project["dependencies"], *(p for extra in DEMO_EXTRAS for p in extras[extra])]
    usual = [packages for name, packages in extras.items() if name not in LARGE_EXTRAS]
    return [*build, *project["dependencies"], *(p for packages in usual for p in packages)]


def pip_step(purpose: str) -> Step:
    """Give the command that installs them. Modules are compiled when they are first imported."""
    pip = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--no-compile"]
    return Step([*pip, *requirements(purpose)], LOGS / f"pip-{purpose}.log", pip_position)


def start() -> None:
    """Install."""
    parser = argparse.ArgumentParser(description="Install what pyproject.toml names.")
    parser.add_argument("purpose", choices=["build", "demo", "developer"])
    purpose = parser.parse_args().purpose
    doing = {
        "build": "Installing Python packages to build with",
        "demo": "Installing Python packages",
        "developer": "Installing Python packages, also those for tests and documentation",
    }[purpose]
    run(doing, pip_step(purpose))


if __name__ == "__main__":
    main(start)
