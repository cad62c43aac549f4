# SPDX-License-Identifier: BSD-3-Clause
"""Where and since when tracking is lost, and the confirmation of a relocalized frame.

``docs/method/relocalization.md``, ``docs/method/several_maps.md#being-lost``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import IntArray
from orbslam2py._values import replace
from orbslam2py.slam.config import RelocalizationConfig

#: Frames after a loss in which the pose predicted by the motion is searched.
MOTION_FRAMES = 10
#: Keyframes around a place, by the points that they share.
COVISIBLE_KEYFRAMES = 10
_LAST_KEYFRAMES = 5  # newest ones, that are candidates after a loss


@dataclass(frozen=True, eq=False)
class LastKnownPose:
    """The last frame with an accepted pose."""

    last: core.TrackedFrame
    """The frame, with its pose."""
    velocity: core.Velocity | None
    """Its velocity; None if it is not known."""
    reference_keyframe: int
    """The keyframe that shares most points with it."""

    def following(self, slam_map: core.Map) -> LastKnownPose:
        """Move the frame and its velocity with the map."""
        _, scale_change, _ = core.follow_map(slam_map, self.last)
        velocity = None if self.velocity is None else self.velocity.scaled(scale_change)
        return replace(self, velocity=velocity)

    def keyframes(self, slam_map: core.Map) -> list[int]:
        """Return the reference keyframe, its best covisible keyframes, and the last ones inserted.

        The most likely first, without repetition.
        """
        reference = slam_map.living(self.reference_keyframe)
        if reference < 0:
            return []
        covisible = slam_map.best_neighbours(reference, COVISIBLE_KEYFRAMES)
        same_map = slam_map.keyframe_ids(slam_map.map_of(reference))
        youngest: IntArray = same_map[: -_LAST_KEYFRAMES - 1 : -1]
        return list(dict.fromkeys([reference, *covisible.tolist(), *youngest.tolist()]))

    def guesses(self, frame: core.TrackedFrame) -> list[core.Pose]:
        """Predict the pose ``T_cw`` of a later frame: by constant velocity, and without motion.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The later frame; the velocity is used for a few frames.
        """
        T_lw = self.last.T_cw
        assert T_lw is not None
        if self.velocity is None or frame.id - self.last.id > MOTION_FRAMES:
            return [T_lw]
        T_cl = self.velocity.over(frame.timestamp - self.last.timestamp)
        return [T_cl @ T_lw, T_lw]


@dataclass(frozen=True, eq=False)
class LostSearch:
    """State of relocalization between two lost frames."""

    place: LastKnownPose | None = None
    """Where tracking was lost; None if it is not lost, or was lost in another map."""
    failures: int = 0
    """Number of frames since then without a pose."""
    recent_scores: tuple[Mapping[int, float], ...] = ()
    """Keyframes that look like one of the last frames, with their scores; the oldest first."""


@dataclass(frozen=True)
class LostTime:
    """Time since when tracking is lost, by time stamps [s]."""

    lost_since: float | None = None
    """None: tracking is not lost."""
    tracked_since: float | None = None
    """First frame with a pose after the loss; a few such frames do not end it."""

    def lost(self, timestamp: float) -> LostTime:
        """Count a frame without a pose."""
        return LostTime(timestamp if self.lost_since is None else self.lost_since)

    def tracked(self, frame: core.TrackedFrame, patience: float | None) -> LostTime:
        """Count a frame with a pose; the loss ends once such frames outlast the patience."""
        if self.lost_since is None:
            return self
        timestamp = frame.timestamp
        since = timestamp if self.tracked_since is None else self.tracked_since
        ended = timestamp - since >= (patience or 0.0)
        return LostTime() if ended else replace(self, tracked_since=since)

    def is_over(self, timestamp: float, patience: float | None) -> bool:
        """Return whether tracking has been lost for longer than the patience."""
        if patience is None or self.lost_since is None:
            return False
        return timestamp - self.lost_since >= patience


#: Lost for ever: the next frame that can begin a map does.
LONG_LOST = LostTime(-math.inf)


@dataclass(frozen=True, eq=False)
class Unconfirmed:
    """A relocalized frame, whose pose the next frame must confirm."""

    T_cw: core.Pose
    points: IntArray = field(repr=False)
    """Ids of the points that the pose was accepted with, ascending."""

    @classmethod
    def of(cls, frame: core.TrackedFrame) -> Unconfirmed:
        """Take a relocalized frame."""
        assert frame.T_cw is not None
        return cls(frame.T_cw, inlier_points(frame))

    def is_confirmed_by(self, frame: core.TrackedFrame, limits: RelocalizationConfig) -> bool:
        """Return whether the next frame sees the same points from nearly the same direction.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The next frame, with pose and associations.
        limits : RelocalizationConfig
            Thresholds.
        """
        assert frame.T_cw is not None
        common = np.intersect1d(self.points, inlier_points(frame), assume_unique=True)
        rotation = (frame.T_cw @ self.T_cw.inverse()).matrix[:3, :3]
        cosine = (np.trace(rotation) - 1) / 2
        return len(common) >= limits.common_points and cosine >= limits.confirming_cosine


def inlier_points(frame: core.TrackedFrame) -> IntArray:
    """Ids of the map points that a pose was accepted with, ascending."""
    ids: IntArray = frame.map_points
    return np.unique(ids[(ids >= 0) & (frame.outlier == 0)])
