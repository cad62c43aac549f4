# SPDX-License-Identifier: BSD-3-Clause
"""Make a folder with the package and the extensions of a build, to be put on PYTHONPATH.

    python scripts/package_with_extensions.py build/asan-ext build/asan-ext/package

The files are links: what is changed in src is changed there.
"""

import argparse
import shutil
from pathlib import Path

SOURCE = Path(__file__).parent.parent / "src" / "orbslam2py"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path, help="where CMake has built the extensions")
    parser.add_argument("folder", type=Path, help="replaced")
    arguments = parser.parse_args()
    shutil.rmtree(arguments.folder, ignore_errors=True)
    for file in SOURCE.rglob("*"):
        if file.is_file() and file.suffix != ".so" and "__pycache__" not in file.parts:
            link = arguments.folder / "orbslam2py" / file.relative_to(SOURCE)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(file.resolve())
    extensions = [
        file
        for file in arguments.build.resolve().rglob("*.so")
        if not file.is_relative_to(arguments.folder.resolve())
    ]
    for file in extensions:
        # Each lies where it is imported from: _core at the top, the others beside their sources.
        sources = [path for path in SOURCE.rglob("*.pyx") if path.stem == file.name.split(".")[0]]
        place = sources[0].parent.relative_to(SOURCE) if sources else Path()
        (arguments.folder / "orbslam2py" / place / file.name).symlink_to(file)


if __name__ == "__main__":
    main()
