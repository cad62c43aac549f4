# SPDX-License-Identifier: BSD-3-Clause
"""Stereo depth of real pairs, against arrays of the reference (bit by bit)."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core as core
from support.data import shared_arrays

pytestmark = pytest.mark.shared

# Name of the pair, keypoints wanted by the extractor.
PAIRS = [("stereo_euroc", 1200), ("stereo_kitti06", 2000)]


@pytest.mark.parametrize(("name", "n_features"), PAIRS)
def test_stereo_frame_equals_the_reference(name: str, n_features: int) -> None:
    golden = shared_arrays(name)
    fx, fy, cx, cy, bf = (float(value) for value in golden["K_bf"])
    left, right = golden["left"], golden["right"]

    options = core.OrbOptions(n_features=n_features, original_coordinates=True)
    extractor = core.PairExtractor(options)
    pair = extractor.extract(left, right)

    height, width = left.shape
    camera = core.Camera(core.CameraOptions(fx, fy, cx, cy, width, height, bf=bf, depth_ratio=35.0))
    context = core.FrameContext(camera, core.ScalePyramid(1.2, 8, original_coordinates=True))
    frame = core.build_stereo_frame(context, 0, 0.0, *pair)

    np.testing.assert_array_equal(frame.keypoints, golden["left_kp"][:, :2])
    np.testing.assert_array_equal(frame.levels, golden["left_kp_octave"])
    assert np.count_nonzero(frame.depth > 0) > 500
    np.testing.assert_array_equal(frame.right_u, golden["uRight"])
    np.testing.assert_array_equal(frame.depth, golden["depth"])
