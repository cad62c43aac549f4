# SPDX-License-Identifier: BSD-3-Clause
"""Install what pyproject.toml names: to build, to run with all extras, to test, to document."""

import subprocess
import sys
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())
wanted = [
    *project["build-system"]["requires"],
    *project["project"]["dependencies"],
    *(
        package
        for extra in project["project"]["optional-dependencies"].values()
        for package in extra
    ),
]
command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
sys.exit(subprocess.run([*command, *wanted], check=False).returncode)
