# SPDX-License-Identifier: BSD-3-Clause
"""What the tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_CHECKOUT = Path(__file__).resolve().parents[2]


def _shared_folder() -> Path:
    return Path(os.environ.get("ORBSLAM2PY_SHARED", _CHECKOUT.parent / "shared"))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the extra data (photographs, real sequences); skips the test without it.

    Mark the test with ``@pytest.mark.shared`` as well, so that it can be left out by name.
    """
    folder = _shared_folder() / "data"
    if not folder.is_dir():
        pytest.skip(f"no extra data in {folder}: set ORBSLAM2PY_SHARED to its folder")
    return folder
