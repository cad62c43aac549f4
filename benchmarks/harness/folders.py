# SPDX-License-Identifier: BSD-3-Clause
"""Where golden problems, photographs, recorded sequences and built programs are."""

from __future__ import annotations

import os
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
GOLDEN = CHECKOUT / "tests" / "data" / "golden"

MISSING = "the sequences are not there: set ORBSLAM2PY_SHARED to their folder"


def shared_folder() -> Path | None:
    """Folder of photographs and recorded sequences, None without it."""
    folder = Path(os.environ.get("ORBSLAM2PY_SHARED", CHECKOUT.parent / "shared")) / "data"
    return folder if folder.is_dir() else None


def needed_shared_folder() -> Path:
    """The same; ends the program without it."""
    folder = shared_folder()
    if folder is None:
        sys.exit(MISSING)
    return folder


def sequence_folder(name: str) -> Path:
    """Folder of a recorded sequence; ends the program where there are none."""
    return needed_shared_folder() / "sequences" / name


def built(build: Path, name: str) -> Path:
    """Path of a C++ program or library of the benchmarks in a build folder."""
    return build / "benchmarks" / "cpp" / name


def how_to_build(build: Path, *names: str) -> str | None:
    """Names missing programs, and how to build them; None if all is there."""
    missing = [name for name in names if not built(build, name).is_file()]
    if not missing:
        return None
    return (
        f"{build} lacks {', '.join(missing)} (cmake --preset release, then cmake --build "
        "build/release --target benchmarks)"
    )
