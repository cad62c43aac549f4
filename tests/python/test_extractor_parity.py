# SPDX-License-Identifier: BSD-3-Clause
"""The extractor on photographs, against arrays the reference produced from them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from orbslam2py import _core

SHARED = Path(
    os.environ.get("ORBSLAM2PY_SHARED", str(Path(__file__).resolve().parents[2] / ".." / "shared"))
)
GOLDEN = SHARED / "data" / "golden"


def load(name: str) -> dict[str, NDArray[np.generic]]:
    """Arrays of one golden file, or a skip naming the missing file."""
    path = GOLDEN / f"extractor_{name}.npz"
    if not path.is_file():
        pytest.skip(f"{path} is missing; ORBSLAM2PY_SHARED names the folder of the extra data")
    with np.load(path) as arrays:
        return dict(arrays)


@pytest.mark.shared
@pytest.mark.parametrize("kernels", ["automatic", "portable"])
@pytest.mark.parametrize("n_features", [1000, 2000])
@pytest.mark.parametrize("name", ["euroc_a", "kitti_a", "tum_a", "synth7", "synth11"])
def test_equals_the_reference(name: str, n_features: int, kernels: str) -> None:
    golden = load(name)
    extractor = _core.OrbExtractor(_core.OrbOptions(n_features=n_features), kernels=kernels)
    result = extractor.extract(golden["image"])

    np.testing.assert_array_equal(result.keypoints, golden[f"n{n_features}_kp"])
    np.testing.assert_array_equal(result.levels, golden[f"n{n_features}_kp_octave"])
    # Products of the pattern rotation are rounded to float32 before the sum (no FMA).
    np.testing.assert_array_equal(result.descriptors, golden[f"nofma_n{n_features}_desc"])
    for level, image in enumerate(result.pyramid):
        np.testing.assert_array_equal(image, golden[f"pyr_l{level}"])
