# SPDX-License-Identifier: BSD-3-Clause
"""Where arrays of the reference and the extra data are."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

CHECKOUT = Path(__file__).resolve().parents[3]

#: Arrays of the reference that are part of the project.
GOLDEN = CHECKOUT / "tests" / "data" / "golden"


def shared_folder() -> Path:
    """Folder of the extra data (photographs, real sequences), whether it exists or not."""
    return Path(os.environ.get("ORBSLAM2PY_SHARED", CHECKOUT.parent / "shared")) / "data"


def shared_arrays(name: str) -> dict[str, npt.NDArray[np.generic]]:
    """Arrays of the reference among the extra data; skips the test where they are missing."""
    path = shared_folder() / "golden" / f"{name}.npz"
    if not path.is_file():
        pytest.skip(f"{path} is missing; ORBSLAM2PY_SHARED names the folder of the extra data")
    with np.load(path) as arrays:
        return dict(arrays)
