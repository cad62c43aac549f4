# SPDX-License-Identifier: BSD-3-Clause
"""Rotations as matrices, quaternions and angles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbslam2py.trajectory.rotations import (
    inverse_poses,
    nearest_rotations,
    quaternions_from_rotations,
    rotation_angles,
    rotations_from_quaternions,
)
from support.made_up_paths import made_up


@given(
    st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 1e-3)
)
@hypothesis_settings(deadline=None)
def test_quaternions(q: list[float]) -> None:
    R = Rotation.from_quat(q).as_matrix()[None]
    ours = quaternions_from_rotations(R)[0]
    assert np.linalg.norm(ours) == pytest.approx(1.0)
    np.testing.assert_allclose(rotations_from_quaternions(ours[None]), R, atol=1e-14)
    np.testing.assert_allclose(Rotation.from_quat(ours).as_matrix(), R[0], atol=1e-14)
    if np.trace(R[0]) > 0:
        assert ours[3] > 0
    else:
        assert ours[np.diag(R[0]).argmax()] > 0


@pytest.mark.parametrize("axis", range(3))
def test_quaternion_of_half_a_turn(axis: int) -> None:
    R = -np.eye(3)
    R[axis, axis] = 1
    expected = np.zeros(4)
    expected[axis] = 1
    np.testing.assert_array_equal(quaternions_from_rotations(R[None])[0], expected)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.1, 3.0, np.pi])
def test_rotation_angle(angle: float) -> None:
    R = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()[None]
    assert rotation_angles(R)[0] == pytest.approx(angle, rel=1e-9, abs=1e-15)


def test_inverse_and_nearest() -> None:
    T = made_up(20).T_wc
    np.testing.assert_allclose(inverse_poses(T) @ T, np.tile(np.eye(4), (20, 1, 1)), atol=1e-12)
    R = T[:, :3, :3]
    np.testing.assert_allclose(nearest_rotations(1.001 * R + 1e-7), R, atol=1e-6)
