# SPDX-License-Identifier: BSD-3-Clause
"""The last frame and the camera's velocity, from which the next pose is predicted.

Mur-Artal, Montiel and Tardos, 2015, section V-B; ``docs/method/tracking.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py._values import replace


def _no_points() -> core.PointBatch:
    return core.PointBatch()


@dataclass(frozen=True, eq=False)
class Motion:
    """The last frame with a pose, and the motion since the frame before it."""

    last_frame: core.TrackedFrame | None = None
    """The last frame with a pose. It is kept while the camera is lost."""
    velocity: core.Velocity | None = None
    """Velocity at the last frame; None where it is not known."""
    last_points: core.PointBatch = field(default_factory=_no_points)
    """Copies of the points of the last frame, made by the last `following`."""
    is_tracked: bool = False
    """The next frame follows the last one: the camera was not lost in between."""
    prediction_covariance: FloatArray | None = None
    """(6, 6), covariance of the pose that an IMU predicts for the next frame; None without an IMU.
    The predicted motion is in `velocity`."""
    map_motion: core.Pose | None = None
    """Motion of the map under the last frame since it was tracked, by local bundle adjustment."""

    @property
    def last(self) -> core.TrackedFrame:
        """The last frame with a pose; only called when there is one."""
        assert self.last_frame is not None
        return self.last_frame

    # ---- what follows from it --------------------------------------------------------------------
    def predict(self, frame: core.TrackedFrame) -> None:
        """Set the pose of a frame by constant velocity; to the last pose without a velocity."""
        core.predict_pose(frame, self.last, self.velocity)

    def prior(self) -> core.PosePrior | None:
        """Return the predicted pose and its information matrix; None without an IMU."""
        if self.prediction_covariance is None or self.velocity is None:
            return None
        T_lw = self.last.T_cw
        assert T_lw is not None
        return core.PosePrior(self.velocity.step @ T_lw, np.linalg.inv(self.prediction_covariance))

    def median_depth(self) -> float:
        """Return the median depth of the points that the last frame saw; 1 without points."""
        T_lw = None if self.last_frame is None else self.last_frame.T_cw
        if T_lw is None or not len(self.last_points):
            return 1.0
        depths = (T_lw @ np.ascontiguousarray(self.last_points.positions))[:, 2]
        return max(1e-6, float(np.median(depths)))

    def deviation_in_image(self) -> float:
        """Return the standard deviation [rad] of the directions of points that an IMU predicts.

        It holds for a point at the median depth of the last frame's points. It is 0 without an IMU.
        The search window of the motion model is three times as wide (`PoseSearch.by_motion_model`).
        """
        if self.prediction_covariance is None:
            return 0.0
        variances = np.diag(self.prediction_covariance)
        return math.sqrt(variances[:3].max() + variances[3:].max() / self.median_depth() ** 2)

    def predict_turned(self, frame: core.TrackedFrame, quaternion_xyzw: FloatArray) -> None:
        """Set the pose of a frame by the translation of the velocity and a given rotation.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        quaternion_xyzw : array of float64, (4,)
            Rotation of directions from the last camera to the frame's camera.
        """
        T_lw = self.last.T_cw
        self.predict(frame)
        assert T_lw is not None and frame.T_cw is not None
        # Position of the new camera in the coordinates of the last one.
        centre = T_lw @ frame.T_cw.center
        rotation = core.Pose(quaternion_xyzw, np.zeros(3))
        frame.T_cw = core.Pose(quaternion_xyzw, -(rotation @ centre)) @ T_lw

    def stand_still(self, frame: core.TrackedFrame) -> None:
        """Set the pose of a frame to that of the last frame."""
        core.predict_pose(frame, self.last, None)

    # ---- the next one ----------------------------------------------------------------------------
    def following(self, slam_map: core.Map) -> Motion:
        """Move the last frame with the map, which local mapping and loop closing have moved."""
        points, scale_change, step = core.follow_map(slam_map, self.last)
        moved = step if step is None or self.map_motion is None else step @ self.map_motion
        velocity = self.velocity
        if velocity is not None and scale_change != 1.0:
            velocity = velocity.scaled(scale_change)
        return replace(self, last_points=points, velocity=velocity, map_motion=moved)

    def after(self, frame: core.TrackedFrame) -> Motion:
        """Make a frame the last one; measure the velocity if both frames are consecutive."""
        velocity = None
        if self.last_frame is not None and self.is_tracked:
            velocity = core.velocity_between(self.last_frame, frame, consecutive=True)
        return self.remembering(frame, velocity)

    def remembering(self, frame: core.TrackedFrame, velocity: core.Velocity | None) -> Motion:
        """Make a tracked frame the last one, with a given velocity."""
        return Motion(frame, velocity, self.last_points, is_tracked=True)

    def lost(self) -> Motion:
        """Forget the velocity: a frame has no pose."""
        return replace(self, velocity=None, is_tracked=False)

    def jumped(self, T_lw: core.Pose | None) -> Motion:
        """Correct the pose of the last frame; None: the correction is not known."""
        if T_lw is None:
            return replace(self, is_tracked=False)
        self.last.T_cw = T_lw
        return self
