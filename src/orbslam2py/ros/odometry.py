# SPDX-License-Identifier: BSD-3-Clause
"""Odometry without jumps: the motion from image to image, independent of corrections of the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import StateError
from orbslam2py.slam.watched_frame import WatchedFrame
from orbslam2py.trajectory.rotations import inverse_poses

#: Attempts to read two poses of one state of the map, which others write.
_ATTEMPTS = 5
#: Numbers of a pose that is read twice differ by less than this if the map did not move.
_STILL = 1e-9


@dataclass(frozen=True, eq=False)
class OdometryStep:
    """Where the camera is in ``odom``, and how it came there.

    Attributes
    ----------
    T_oc
        (4, 4) camera to ``odom``.
    T_before_after
        (4, 4) pose of this image in the camera's coordinates at the image before; None at the
        beginning, and after a change to another map.
    seconds
        Time since the image before.
    """

    T_oc: FloatArray
    T_before_after: FloatArray | None
    seconds: float


class SmoothOdometry:
    """Adds up the motion between images, in the thread that tracks.

    The pose of the image before follows its reference keyframe, so a correction of the map between
    the two images moves both and their difference stays. Over a tracking loss the motion is that
    between the last pose and the first one after it. If the camera is in another map then, the path
    goes on where it stopped.

    Parameters
    ----------
    slam_map
        The map that frames are tracked in.
    """

    def __init__(self, slam_map: core.Map) -> None:
        self._map = slam_map
        self._before: core.TrackedFrame | None = None
        self._time, self._map_index = 0.0, -1
        self._T_oc: FloatArray | None = None

    def add(self, watched: WatchedFrame) -> OdometryStep | None:
        """Take an image; None if it has no pose."""
        record, kept = watched.record, watched.kept_pose()
        if record.T_wc is None or kept is None:
            return None
        is_same_map = self._before is not None and record.map_index == self._map_index
        moved = self._motion(self._before, kept) if is_same_map and self._before else None
        if self._T_oc is None:
            self._T_oc = record.T_wc
        elif moved is not None:
            self._T_oc = self._T_oc @ moved
        step = OdometryStep(self._T_oc.copy(), moved, record.timestamp - self._time)
        self._before, self._time, self._map_index = kept, record.timestamp, record.map_index
        return step

    def _motion(self, before: core.TrackedFrame, now: core.TrackedFrame) -> FloatArray | None:
        """Return the pose of now in the coordinates of before; None if the map is no more."""
        for _ in range(_ATTEMPTS):
            first = self._pose(before)
            second = self._pose(now)
            again = self._pose(before)
            if first is None or second is None or again is None:
                return None
            if np.allclose(first, again, rtol=0, atol=_STILL):  # the map has not moved
                return np.asarray(first @ inverse_poses(second), np.float64)
        return None

    def _pose(self, frame: core.TrackedFrame) -> FloatArray | None:
        """Return ``T_cw`` in the present map; None if the map of the frame is no more."""
        try:
            core.follow_map(self._map, frame)
        except StateError:
            return None
        T_cw = frame.T_cw
        return None if T_cw is None else np.asarray(T_cw.matrix, np.float64)
