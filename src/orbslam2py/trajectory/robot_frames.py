# SPDX-License-Identifier: BSD-3-Clause
"""Poses of a robot from poses of its camera: the conventions of REP 103 and REP 105.

A camera looks along +z, x is right, y is down (an optical frame). A robot's x is forward, y is
left, z is up. ``map`` is where the robot's base was at the first keyframe of the map. Where an IMU
has turned the map upright, ``map`` is at the camera's position there, with z up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.trajectory.level import T_LEVEL, moved
from orbslam2py.trajectory.rotations import inverse_poses

#: From the coordinates of a camera that looks forward to those of a robot: x, y, z of the robot are
#: z, -x, -y of the camera (REP 103).
R_ROBOT_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def pose_of_forward_camera() -> FloatArray:
    """Return ``T_base_camera`` (4, 4) of a camera at the base that looks forward."""
    T = np.eye(4)
    T[:3, :3] = R_ROBOT_OPTICAL
    return T


@dataclass(frozen=True, eq=False)
class RobotBase:
    """Where the camera is on a robot.

    Attributes
    ----------
    T_base_camera
        (4, 4) [m], from the (left, rectified) camera's coordinates to those of the base.
    """

    T_base_camera: FloatArray = field(default_factory=pose_of_forward_camera)

    def pose(self, T_wc: FloatArray, *, is_upright: bool = False) -> FloatArray:
        """Return ``T_map_base`` (..., 4, 4) of poses ``T_wc`` (..., 4, 4) of the camera.

        `is_upright`: an IMU has turned the world, which has z up.
        """
        T: FloatArray = self.to_map(is_upright) @ T_wc @ inverse_poses(self.T_base_camera)
        return T

    def points(self, points: FloatArray, *, is_upright: bool = False) -> FloatArray:
        """Return points (n, 3) of the map's world in the coordinates of ``map``."""
        return moved(self.to_map(is_upright), np.asarray(points, np.float64))

    def to_map(self, is_upright: bool) -> FloatArray:
        """Return the transform (4, 4) from the map's world to ``map``."""
        return pose_of_forward_camera() @ T_LEVEL if is_upright else self.T_base_camera

    def covariance(self, covariance: FloatArray, R_axes_camera: FloatArray) -> FloatArray:
        """Convert the covariance of a camera's pose to that of the base, in ROS's order.

        Parameters
        ----------
        covariance
            (6, 6) of rotation [rad], then translation [m], a left perturbation in the frame of the
            camera: see `TrackingRecord.covariance`.
        R_axes_camera
            (3, 3) from the coordinates of the camera to the axes wanted: those of ``map``, of
            ``odom`` or of the base.

        Returns
        -------
        array (6, 6)
            Of x, y, z of the base [m], then of rotations about the fixed axes x, y, z [rad], all
            along the wanted axes, as ``geometry_msgs/PoseWithCovariance`` has it.
        """
        # T_cw is exp(w, v) T_cw: a point p of the camera's frame moves by -(w x p + v), and the
        # base turns by -w. Its place in the camera's frame is p.
        p = inverse_poses(self.T_base_camera)[:3, 3]
        cross = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
        J = np.zeros((6, 6))
        J[:3, :3] = R_axes_camera @ cross
        J[:3, 3:] = -R_axes_camera
        J[3:, :3] = -R_axes_camera
        return np.asarray(J @ covariance @ J.T, np.float64)


def twist_between(T_before_after: FloatArray, seconds: float) -> FloatArray:
    """Return the velocity over a step, as a body feels it at its end.

    Parameters
    ----------
    T_before_after
        (4, 4) pose at the end in the body's coordinates at the beginning.
    seconds
        Duration, above 0.

    Returns
    -------
    array (6,)
        Linear velocity [m/s], then angular velocity [rad/s], in the body's coordinates at the end.
    """
    R, t = T_before_after[:3, :3], T_before_after[:3, 3]
    sine_axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine = float(np.linalg.norm(sine_axis))
    angle = float(np.arctan2(sine, (np.trace(R) - 1) / 2))
    turned = sine_axis * (angle / sine if sine > 1e-9 else 1.0)
    return np.concatenate([R.T @ t, turned]) / seconds
