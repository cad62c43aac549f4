# SPDX-License-Identifier: BSD-3-Clause
"""The extractor on photographs, against arrays the reference produced from them."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core
from support.data import shared_arrays


@pytest.mark.shared
@pytest.mark.parametrize("kernels", _core.vector_units())
@pytest.mark.parametrize("n_features", [1000, 2000])
@pytest.mark.parametrize("name", ["euroc_a", "kitti_a", "tum_a", "synth7", "synth11"])
def test_equals_the_reference(name: str, n_features: int, kernels: str) -> None:
    golden = shared_arrays(f"extractor_{name}")
    options = _core.OrbOptions(n_features=n_features, original_coordinates=True)
    extractor = _core.OrbExtractor(options, kernels=kernels)
    result = extractor.extract(golden["image"])

    np.testing.assert_array_equal(result.keypoints, golden[f"n{n_features}_kp"])
    np.testing.assert_array_equal(result.levels, golden[f"n{n_features}_kp_octave"])
    # Products of the pattern rotation are rounded to float32 before the sum (no FMA).
    np.testing.assert_array_equal(result.descriptors, golden[f"nofma_n{n_features}_desc"])
    for level, image in enumerate(result.pyramid):
        np.testing.assert_array_equal(image, golden[f"pyr_l{level}"])
