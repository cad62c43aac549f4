# SPDX-License-Identifier: BSD-3-Clause
"""Errors through the nearest keyframe, against poses made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py.errors import DatasetError
from orbslam2py.evaluation import (
    PoseError,
    errors_through_keyframes,
    nearest_keyframes,
    pose_error,
)


def pose(position: list[float], degrees: float = 0.0) -> np.ndarray:
    """Turned about the y axis."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    T[:3, 3] = position
    return T


def poses(*rows: tuple[float, float]) -> np.ndarray:
    """Along z: metres and degrees."""
    return np.array([pose([0, 0, z], degrees) for z, degrees in rows])


# ---- two poses -----------------------------------------------------------------------------------
def test_pose_error_is_that_of_the_motion_between_both() -> None:
    truth = pose([1, 2, 3], 30)
    error = pose_error(truth @ pose([0.03, 0, 0.04], -7), truth)
    assert error.translation_m == pytest.approx(0.05)
    assert error.rotation_deg == pytest.approx(7)
    back = pose_error(truth, truth @ pose([0.03, 0, 0.04], -7))
    assert back.translation_m == pytest.approx(0.05)
    assert back.rotation_deg == pytest.approx(7)


def test_half_a_turn_and_none() -> None:
    assert pose_error(np.eye(4), np.eye(4)) == PoseError(0, 0)
    assert pose_error(pose([0, 0, 0], 180), np.eye(4)).rotation_deg == pytest.approx(180)


def test_limits_hold_for_both() -> None:
    error = PoseError(0.02, 0.5)
    assert error.is_within(0.02, 0.5)
    assert not error.is_within(0.019, 0.5)
    assert not error.is_within(0.02, 0.49)


# ---- which keyframe ------------------------------------------------------------------------------
def test_a_metre_is_as_far_as_a_radian() -> None:
    keyframes = poses((0, 0), (1, np.degrees(0.5)))
    cameras = poses((0, 0), (0.7, 0), (0.8, 0), (0.2, np.degrees(0.5)))
    # From the second camera: 0.7 to the first keyframe, 0.3 + 0.5 to the second.
    assert nearest_keyframes(cameras, keyframes).tolist() == [0, 0, 1, 0]


def test_no_cameras_and_no_keyframes() -> None:
    nobody = np.zeros((0, 4, 4))
    assert nearest_keyframes(nobody, poses((0, 0))).shape == (0,)
    with pytest.raises(DatasetError, match="no keyframes"):
        nearest_keyframes(poses((0, 0)), nobody)


# ---- errors --------------------------------------------------------------------------------------
def test_drift_of_the_map_does_not_count() -> None:
    """The second half of the map lies beside the truth; cameras in both are exact in it."""
    true_T_wk = poses((0, 0), (10, 0))
    drift = pose([0.5, 0.1, 0.2], 4)
    T_wk = np.array([true_T_wk[0], drift @ true_T_wk[1]])
    true_T_wc = poses((1, 5), (9, -5))
    T_wc = np.array([true_T_wc[0], drift @ true_T_wc[1]])
    translations, rotations = errors_through_keyframes(T_wc, true_T_wc, T_wk, true_T_wk)
    np.testing.assert_allclose(translations, 0, atol=1e-12)
    np.testing.assert_allclose(rotations, 0, atol=1e-12)
    # The same in another world than the truth's.
    world = pose([3, 4, 5], 77)
    moved = errors_through_keyframes(world @ T_wc, true_T_wc, world @ T_wk, true_T_wk)
    np.testing.assert_allclose(moved, 0, atol=1e-12)


def test_error_of_the_camera_counts() -> None:
    true_T_wk = poses((0, 0), (10, 0))
    true_T_wc = poses((1, 5), (9, -5))
    off = pose([0.03, 0, 0.04], 2)
    translations, rotations = errors_through_keyframes(
        true_T_wc @ off, true_T_wc, true_T_wk, true_T_wk
    )
    np.testing.assert_allclose(translations, 0.05)
    np.testing.assert_allclose(np.degrees(rotations), 2)


def test_lengths_of_a_single_camera_are_scaled() -> None:
    true_T_wk, true_T_wc = poses((0, 0), (10, 0)), poses((1, 5), (8, 0))
    T_wk, T_wc = true_T_wk.copy(), true_T_wc.copy()
    for estimated in (T_wk, T_wc):
        estimated[:, :3, 3] *= 0.2
    T_wc[1, 2, 3] += 0.2 * 0.3
    before = T_wk.copy(), T_wc.copy()
    translations, _ = errors_through_keyframes(
        T_wc, true_T_wc, T_wk, true_T_wk, metres_per_unit=5.0
    )
    np.testing.assert_allclose(translations, [0, 0.3], atol=1e-12)
    np.testing.assert_array_equal(T_wk, before[0], "the caller's poses stay as they are")
    np.testing.assert_array_equal(T_wc, before[1])
