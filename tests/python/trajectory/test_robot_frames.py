# SPDX-License-Identifier: BSD-3-Clause
"""Poses of a robot's base by REP 103 and REP 105."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.trajectory.robot_frames import RobotBase, pose_of_forward_camera, twist_between


def _moved(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def test_a_camera_that_moves_forward_moves_the_base_along_x() -> None:
    base = RobotBase()
    np.testing.assert_allclose(base.pose(_moved(0, 0, 2))[:3, 3], [2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(base.pose(_moved(1, 0, 0))[:3, 3], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(base.pose(_moved(0, 1, 0))[:3, 3], [0, 0, -1], atol=1e-12)


def test_a_turn_to_the_right_is_one_about_minus_z_and_moves_the_base_around() -> None:
    T_bc = pose_of_forward_camera()
    T_bc[:3, 3] = 0.5, 0.0, 0.3  # half a metre before the base
    angle = np.pi / 2
    turn = np.eye(4)  # about y of the camera, which is down: to the right
    turn[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)],
        [0, 1, 0],
        [-np.sin(angle), 0, np.cos(angle)],
    ]
    T_mb = RobotBase(T_bc).pose(turn)
    np.testing.assert_allclose(T_mb[:3, :3], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
    # The camera stays where it is, and the base is half a metre behind it, to the left of before.
    np.testing.assert_allclose(T_mb[:3, 3], [0.5, 0.5, 0], atol=1e-12)


def test_points_of_the_world_lie_where_the_camera_was_on_the_base() -> None:
    T_bc = pose_of_forward_camera()
    T_bc[:3, 3] = 0.2, 0.0, 0.5
    at = RobotBase(T_bc).points(np.array([[1.0, 2.0, 3.0]]))
    np.testing.assert_allclose(at, [[3.2, -1.0, -1.5]], atol=1e-12)


@pytest.mark.parametrize("axes", ["map", "base"])
def test_the_covariance_is_that_of_many_poses(axes: str) -> None:
    rng = np.random.default_rng(3)
    T_bc = pose_of_forward_camera()
    T_bc[:3, 3] = 0.4, -0.1, 0.6
    base = RobotBase(T_bc)
    T_cw = core.Pose.exp([0.3, -0.8, 0.4, 1.0, 2.0, -0.5])
    deviations = np.array([2e-3, 3e-3, 1e-3, 2e-2, 1e-2, 3e-2])
    mixed = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    L = np.diag(deviations) @ mixed
    T_mb = base.pose(np.linalg.inv(T_cw.matrix))
    R_axes = np.eye(3) if axes == "map" else T_mb[:3, :3].T
    errors = []
    for xi in rng.normal(size=(5_000, 6)) @ L.T:
        other = base.pose(np.linalg.inv((core.Pose.exp(xi) @ T_cw).matrix))
        turned = other[:3, :3] @ T_mb[:3, :3].T  # about fixed axes
        rotation = [turned[2, 1], turned[0, 2], turned[1, 0]]
        errors.append([*(R_axes @ (other[:3, 3] - T_mb[:3, 3])), *(R_axes @ rotation)])
    R_map_camera = (T_bc @ np.linalg.inv(T_cw.matrix))[:3, :3]
    expected = base.covariance(L @ L.T, R_axes @ R_map_camera)
    measured = np.cov(np.array(errors).T)
    scale = np.sqrt(np.outer(np.diag(measured), np.diag(measured)))
    np.testing.assert_allclose(expected / scale, measured / scale, atol=0.06)


def test_a_twist_is_felt_by_the_body_at_the_end() -> None:
    step = np.eye(4)
    step[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # a quarter turn to the left
    step[:3, 3] = 1.0, 0.0, 0.0
    twist = twist_between(step, 0.5)
    np.testing.assert_allclose(twist, [0, -2, 0, 0, 0, np.pi], atol=1e-12)
    np.testing.assert_allclose(twist_between(np.eye(4), 0.1), np.zeros(6))
