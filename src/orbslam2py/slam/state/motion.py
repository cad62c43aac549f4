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

#: Seconds over which a velocity is taken to be constant.
_LONGEST = 1.0
#: Relative difference of two intervals that is rounding of the time stamps.
_SAME_INTERVAL = 1e-6


def _no_points() -> core.PointBatch:
    return core.PointBatch()


@dataclass(frozen=True, eq=False)
class Velocity:
    """A velocity, constant in the axes of the camera: the motion over an interval."""

    step: core.Pose
    """Motion over the interval, ``T_cl``."""
    seconds: float
    """The interval; negative where frames are tracked backwards in time."""

    def over(self, seconds: float) -> core.Pose:
        """Return the motion over another interval; over more than a second, that over a second."""
        if abs(seconds - self.seconds) <= _SAME_INTERVAL * abs(self.seconds):
            return self.step
        seconds = math.copysign(min(abs(seconds), _LONGEST), seconds)
        return self.step.power(seconds / self.seconds)

    def scaled(self, scale_change: float) -> Velocity:
        """Return the velocity after a loop has corrected the scale of a single camera's map."""
        if scale_change == 1.0:
            return self
        translation = scale_change * self.step.translation
        return replace(self, step=core.Pose(self.step.quaternion_xyzw, translation))


@dataclass(frozen=True, eq=False)
class Motion:
    """The last frame with a pose, and the motion since the frame before it."""

    last_frame: core.TrackedFrame | None = None
    """The last frame with a pose. It is kept while the camera is lost."""
    velocity: Velocity | None = None
    """Velocity at the last frame; None where it is not known."""
    last_points: core.PointBatch = field(default_factory=_no_points)
    """Copies of the points of the last frame, made by the last `following`."""
    is_tracked: bool = False
    """The next frame follows the last one: the camera was not lost in between."""
    prediction_covariance: FloatArray | None = None
    """(6, 6), of the next pose, whose motion `velocity` holds as an IMU predicts it; None without
    one."""
    map_motion: core.Pose | None = None
    """Motion of the map under the last frame since it was tracked, by local bundle adjustment."""

    @property
    def last(self) -> core.TrackedFrame:
        """The last frame with a pose, where there is one."""
        assert self.last_frame is not None
        return self.last_frame

    # ---- what follows from it --------------------------------------------------------------------
    def predicted(self, timestamp: float) -> core.Pose | None:
        """Return the motion ``T_cl`` from the last frame to a time [s]; None without a velocity."""
        if self.velocity is None:
            return None
        return self.velocity.over(timestamp - self.last.timestamp)

    def velocity_at(self, frame: core.TrackedFrame) -> Velocity | None:
        """Return the velocity between the last frame and a frame; None without a pose of either."""
        T_cl = self.since_last(frame)
        return None if T_cl is None else Velocity(T_cl, frame.timestamp - self.last.timestamp)

    def predict(self, frame: core.TrackedFrame) -> None:
        """Set the pose of a frame by constant velocity; without one, to that of the last frame."""
        T_lw = self.last.T_cw
        assert T_lw is not None
        T_cl = self.predicted(frame.timestamp)
        frame.T_cw = T_lw if T_cl is None else T_cl @ T_lw
        frame.share_anchor(self.last)

    def prior(self) -> core.PosePrior | None:
        """Return the predicted pose with its information, where an IMU predicts it."""
        T_lw = None if self.last_frame is None else self.last_frame.T_cw
        if self.prediction_covariance is None or self.velocity is None or T_lw is None:
            return None
        return core.PosePrior(self.velocity.step @ T_lw, np.linalg.inv(self.prediction_covariance))

    def median_depth(self) -> float:
        """Return the median depth of the points that the last frame saw; 1 without points."""
        T_lw = None if self.last_frame is None else self.last_frame.T_cw
        if T_lw is None or not len(self.last_points):
            return 1.0
        depths = (T_lw @ np.ascontiguousarray(self.last_points.positions))[:, 2]
        return max(1e-6, float(np.median(depths)))

    def deviation_in_image(self) -> float:
        """Return the standard deviation [rad] of the directions of predicted points, by an IMU.

        It is that of points at the median depth of those that the last frame saw; 0 without an IMU.
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
        assert T_lw is not None
        # Position of the new camera in the coordinates of the last one.
        T_cl = self.predicted(frame.timestamp)
        centre = np.zeros(3) if T_cl is None else T_cl.center
        rotation = core.Pose(quaternion_xyzw, np.zeros(3))
        frame.T_cw = core.Pose(quaternion_xyzw, -(rotation @ centre)) @ T_lw
        frame.share_anchor(self.last)

    def stand_still(self, frame: core.TrackedFrame) -> None:
        """Set the pose of a frame to that of the last frame."""
        frame.T_cw = self.last.T_cw
        frame.share_anchor(self.last)

    def since_last(self, frame: core.TrackedFrame) -> core.Pose | None:
        """Return the motion ``T_cl`` from the last frame; None without a pose of either."""
        T_lw = None if self.last_frame is None else self.last_frame.T_cw
        if T_lw is None or frame.T_cw is None:
            return None
        return frame.T_cw @ T_lw.inverse()

    def innovation(self, frame: core.TrackedFrame) -> FloatArray | None:
        """Return the tangent (6,) from a pose to the predicted one: rotation [rad], translation.

        None where no velocity is known.
        """
        if self.velocity is None or self.last_frame is None or frame.T_cw is None:
            return None
        T_lw = self.last_frame.T_cw
        if T_lw is None:
            return None
        T_cl = self.velocity.over(frame.timestamp - self.last.timestamp)
        tangent: FloatArray = (T_cl @ T_lw @ frame.T_cw.inverse()).log()
        return tangent

    def map_motion_at(self, frame: core.TrackedFrame) -> FloatArray | None:
        """Return the motion of the map (6,), rotation [rad] and translation, in a frame's axes.

        None where local bundle adjustment has not moved the last frame.
        """
        T_cl = self.since_last(frame)
        if self.map_motion is None or T_cl is None:
            return None
        tangent: FloatArray = (T_cl @ self.map_motion @ T_cl.inverse()).log()
        return tangent

    # ---- the next one ----------------------------------------------------------------------------
    def following(self, slam_map: core.Map) -> Motion:
        """Move the last frame with the map, which local mapping and loop closing have moved."""
        last = self.last
        before, big_change = last.T_cw, last.big_change
        points, scale_change = core.follow_map(slam_map, last)
        moved = self.map_motion
        if last.big_change != big_change:
            moved = None  # by a loop, which corrects an error of long before
        elif before is not None and last.T_cw is not None:
            step = last.T_cw @ before.inverse()
            moved = step if moved is None else step @ moved
        velocity = None if self.velocity is None else self.velocity.scaled(scale_change)
        return replace(self, last_points=points, velocity=velocity, map_motion=moved)

    def after(self, frame: core.TrackedFrame) -> Motion:
        """Measure the velocity, if the frame is consecutive, and make it the last one."""
        last, velocity = self.last_frame, None
        if last is not None and self.is_tracked:
            follows = frame.id == last.id + 1 and frame.big_change == last.big_change
            velocity = self.velocity_at(frame) if follows else None
        return self.remembering(frame, velocity)

    def remembering(self, frame: core.TrackedFrame, velocity: Velocity | None) -> Motion:
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
