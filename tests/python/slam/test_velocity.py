# SPDX-License-Identifier: BSD-3-Clause
"""A velocity predicts motions over any interval, not from one image to the next."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.slam.state import Motion


def turning(seconds: float) -> core.Pose:
    """One radian a second about y, and a metre a second along the camera's x."""
    return core.Pose.exp([0.0, seconds, 0.0, seconds, 0.0, 0.0])


def frame(seconds: float, T_cw: core.Pose | None = None) -> core.TrackedFrame:
    """A frame of ten images a second, without keypoints."""
    scales = core.ScalePyramid(1.2, 8)
    context = core.FrameContext(core.Camera(core.CameraOptions(50, 50, 32, 24, 64, 48)), scales)
    extraction = core.OrbExtractor(core.OrbOptions()).extract(np.zeros((48, 64), np.uint8), None)
    built = core.build_monocular_frame(context, round(10 * seconds), seconds, extraction)
    tracked = core.TrackedFrame(built)
    tracked.T_cw = T_cw
    return tracked


@pytest.mark.parametrize("dropped", [0, 1, 4])
def test_dropped_images_do_not_change_the_prediction(dropped: int) -> None:
    motion = Motion(frame(0.0, turning(0.0)), None, is_tracked=True).after(frame(0.1, turning(0.1)))
    later = frame(0.1 * (2 + dropped))
    motion.predict(later)
    assert later.T_cw is not None
    np.testing.assert_allclose(later.T_cw.matrix, turning(later.timestamp).matrix, atol=1e-12)
    change = core.change_from_prediction(later, motion.last, motion.velocity)
    np.testing.assert_allclose(change, 0, atol=1e-12)


def test_a_rotation_from_elsewhere_keeps_the_predicted_place() -> None:
    motion = Motion(frame(0.0, turning(0.0)), None, is_tracked=True).after(frame(0.1, turning(0.1)))
    later = frame(0.2)
    half_turn = np.array([0.0, 1.0, 0.0, 0.0])
    motion.predict_turned(later, half_turn)
    assert later.T_cw is not None
    np.testing.assert_allclose(later.T_cw.center, turning(0.2).center, atol=1e-12)
    expected = core.Pose(half_turn, np.zeros(3)) @ turning(0.1)
    np.testing.assert_allclose(later.T_cw.rotation_matrix, expected.rotation_matrix, atol=1e-12)


def test_a_camera_that_was_lost_in_between_has_no_velocity() -> None:
    motion = Motion(frame(0.0, turning(0.0)), None, is_tracked=True).lost()
    assert motion.after(frame(0.1, turning(0.1))).velocity is None
