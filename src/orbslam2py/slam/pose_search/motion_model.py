# SPDX-License-Identifier: BSD-3-Clause
"""Where the camera should be, by the last frame and its speed.

Mur-Artal, Montiel and Tardos, 2015, section V-B; ``docs/method/tracking.md``.
"""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray


class MotionModel:
    """The last frame that had a pose, and the motion since the one before it.

    Attributes
    ----------
    velocity : Pose or None
        Motion from the last frame to the next, ``T_cl``; None where none is known.
    last_points : PointBatch
        Copies of the points that the last frame saw, as of the last `follow_map`.
    """

    def __init__(self) -> None:
        self.velocity: core.Pose | None = None
        self.last_points = core.PointBatch()
        self._last: core.TrackedFrame | None = None
        self._last_tracked = False
        self._moved: core.Pose | None = None

    @property
    def has_last(self) -> bool:
        """Whether any frame had a pose."""
        return self._last is not None

    @property
    def last(self) -> core.TrackedFrame:
        """The last frame that had a pose; stays where tracking was lost."""
        assert self._last is not None
        return self._last

    def follow_map(self, slam_map: core.Map) -> None:
        """Bring the last frame up to date with the map, which mapping and loop closing move."""
        last = self.last
        before, big_change = last.T_cw, last.big_change
        self.last_points, stretched = core.follow_map(slam_map, last)
        if last.big_change != big_change:
            # By a loop: that is told otherwise, and takes out an error of long before.
            self._moved = None
        elif before is not None and last.T_cw is not None:
            moved = last.T_cw @ before.inverse()
            self._moved = moved if self._moved is None else moved @ self._moved
        if self.velocity is not None and stretched != 1.0:
            # A single camera's loop took out a drift of scale, in which the speed was measured.
            self.velocity = core.Pose(
                self.velocity.quaternion_xyzw, stretched * self.velocity.translation
            )

    def move_of_map(self, frame: core.TrackedFrame) -> FloatArray | None:
        """How far adjustment moved the map under the last frame, (6,) rotation [rad] and way.

        In the camera's axes of `frame`, since the last one was tracked; None where it did not.
        """
        T_cl = self.way(frame)
        if self._moved is None or T_cl is None:
            return None
        move: FloatArray = (T_cl @ self._moved @ T_cl.inverse()).log()
        return move

    def way(self, frame: core.TrackedFrame) -> core.Pose | None:
        """The motion ``T_cl`` from the last frame to this one; None without a pose of either."""
        T_lw = None if self._last is None else self._last.T_cw
        if T_lw is None or frame.T_cw is None:
            return None
        return frame.T_cw @ T_lw.inverse()

    def change(self, frame: core.TrackedFrame) -> FloatArray | None:
        """From a frame's pose to the one that the speed leads to, (6,) rotation [rad] and way.

        None where no speed is known.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame after the last one, with its pose.
        """
        if self.velocity is None or self._last is None or frame.T_cw is None:
            return None
        T_lw = self._last.T_cw
        if T_lw is None:
            return None
        change: FloatArray = (self.velocity @ T_lw @ frame.T_cw.inverse()).log()
        return change

    def predict(self, frame: core.TrackedFrame) -> None:
        """Give a frame the pose that the speed leads to, or the last frame's without a speed."""
        T_lw = self.last.T_cw
        assert T_lw is not None
        frame.T_cw = T_lw if self.velocity is None else self.velocity @ T_lw
        frame.share_anchor(self.last)

    def predict_turned(self, frame: core.TrackedFrame, quaternion_xyzw: FloatArray) -> None:
        """Give a frame the pose on the way that the speed leads to, but turned as given.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        quaternion_xyzw : array of float64, (4,)
            Rotation of the last camera's directions into the frame's.
        """
        T_lw = self.last.T_cw
        assert T_lw is not None
        # Where the camera's centre goes, in the last camera's frame.
        way = np.zeros(3) if self.velocity is None else self.velocity.center
        turn = core.Pose(quaternion_xyzw, np.zeros(3))
        frame.T_cw = core.Pose(quaternion_xyzw, -(turn @ way)) @ T_lw
        frame.share_anchor(self.last)

    def stand_still(self, frame: core.TrackedFrame) -> None:
        """Give a frame the last frame's pose."""
        frame.T_cw = self.last.T_cw
        frame.share_anchor(self.last)

    def jump(self, T_lw: core.Pose | None) -> None:
        """The last frame was elsewhere than it seemed; None: nobody knows where."""
        if T_lw is None:
            self._last_tracked = False
        else:
            self.last.T_cw = T_lw

    def remember(self, frame: core.TrackedFrame) -> None:
        """Make a tracked frame the last one."""
        self._last = frame
        self._last_tracked = True
        self._moved = None

    def update_velocity(self, frame: core.TrackedFrame) -> None:
        """Measure the motion from the last frame to this one, if they follow each other."""
        last = self._last
        self.velocity = None
        if last is None or not self._last_tracked:
            return
        if frame.id == last.id + 1 and frame.big_change == last.big_change:
            self.velocity = self.way(frame)

    def lose(self) -> None:
        """Tracking was lost: the speed is unknown."""
        self.velocity = None
        self._last_tracked = False
