# SPDX-License-Identifier: BSD-3-Clause
"""How a map begins: from one frame with depths, or from two views of a single camera.

Mur-Artal, Montiel and Tardos, 2015, section IV; Mur-Artal and Tardos, 2017, section III-B;
``docs/method/start.md``.
"""

from __future__ import annotations

import logging
import sys
from typing import Protocol

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.records import Reason
from orbslam2py.slam.thresholds import InitializationThresholds
from orbslam2py.slam.watched_frame import pixels_as_given

_log = logging.getLogger(__name__)


class Initializer(Protocol):
    """Begins a map from the frames that come."""

    def reset(self) -> None:
        """Forget the frames before."""
        ...

    def lines(self) -> FloatArray | None:
        """What the last frame was matched with, for those who watch.

        Returns
        -------
        array (m, 4) or None
            Pixels of the images as given: x and y in the first view, then in the last frame. None
            where a map does not begin from two views.
        """
        ...

    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Begin the map with this frame; or say why not (`Reason.NONE`: it has begun)."""
        ...


class DepthInitializer:
    """Begins a map from one frame of a sensor that sees depth (ORB-SLAM2, section III-B).

    The camera's frame becomes the world's frame.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Describes the first keyframe.
    mapping : LocalMapping
        Takes it.
    thresholds : InitializationThresholds, optional
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        thresholds: InitializationThresholds | None = None,
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._limits = thresholds or InitializationThresholds()

    def reset(self) -> None:
        """Nothing is kept from frame to frame."""

    def lines(self) -> FloatArray | None:
        """None: one frame is enough."""
        return None

    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Make the frame keyframe 0, with a map point for every depth; or say why not."""
        if frame.features.size <= self._limits.keypoints_with_depth_sensor:
            return Reason.TOO_FEW_KEYPOINTS
        if int(np.count_nonzero(frame.features.depth > 0)) < self._limits.depths:
            return Reason.TOO_FEW_DEPTHS
        frame.T_cw = core.Pose()
        core.describe(frame.features, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=True, n_minimum=sys.maxsize)
        self._mapping.insert_keyframe(keyframe)
        _log.info("new map with %d points", self._map.n_points)
        return Reason.NONE


#: What the two views' reconstruction says, in the words of a record.
_REASONS = {
    "too_few_matches": Reason.FEW_MATCHES_FIRST_VIEW,
    "degenerate_points": Reason.DEGENERATE_VIEWS,
    "no_model": Reason.DEGENERATE_VIEWS,
    "degenerate_plane": Reason.DEGENERATE_VIEWS,
    "too_few_points": Reason.DEGENERATE_VIEWS,
    "low_parallax": Reason.LOW_PARALLAX,
    "ambiguous_motion": Reason.AMBIGUOUS_MOTION,
}


class MonocularInitializer:
    """Keeps a first view and tries to reconstruct the scene from it and each later one.

    The first view's frame becomes the world's frame; its median depth becomes 1.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Describes the first keyframes.
    mapping : LocalMapping
        Takes the two first keyframes.
    seed : int
        Seed of the draws.
    thresholds : InitializationThresholds, optional
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        seed: int,
        thresholds: InitializationThresholds | None = None,
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._seed = seed
        self._limits = thresholds or InitializationThresholds()
        self.reset()

    def reset(self) -> None:
        """Drop the first view."""
        self._first: core.TrackedFrame | None = None
        self._positions = np.zeros((0, 2), np.float32)
        self._last: core.TrackedFrame | None = None
        self._matches = np.zeros(0, np.int32)

    def lines(self) -> FloatArray | None:
        """From each keypoint of the first view to its match in the last frame, (m, 4) pixels."""
        if self._first is None or self._last is None:
            return np.zeros((0, 4))
        matched = np.flatnonzero(self._matches >= 0)
        seen_first = pixels_as_given(self._first.features)[matched]
        seen_last = pixels_as_given(self._last.features)[self._matches[matched]]
        return np.hstack([seen_first, seen_last]).astype(np.float64)

    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Begin the map with this frame as second view; or say why not."""
        if frame.features.size <= self._limits.keypoints:
            self.reset()
            return Reason.TOO_FEW_KEYPOINTS
        if self._first is None:
            self._first = frame
            self._positions = frame.features.keypoints
            return Reason.FIRST_VIEW

        first = self._first
        matches, self._positions = core.match_for_initialization(
            first.features, frame.features, self._positions, self._limits.window, self._limits.ratio
        )
        self._last, self._matches = frame, matches
        if np.count_nonzero(matches >= 0) < self._limits.matches:
            self.reset()
            return Reason.FEW_MATCHES_FIRST_VIEW
        views = core.reconstruct_two_views(
            first.features.keypoints,
            frame.features.keypoints,
            matches,
            intrinsics(frame.features.camera),
            seed=self._seed,
            # Each model takes about a millisecond: a busy machine starts a thread no sooner.
            two_threads=False,
        )
        if not views.success:
            return _REASONS[views.outcome.name]
        return self._build_map(first, frame, matches, views)

    def _build_map(
        self,
        first: core.TrackedFrame,
        second: core.TrackedFrame,
        matches: np.ndarray,
        views: core.TwoViewResult,
    ) -> Reason:
        core.describe(first.features, self._vocabulary)
        core.describe(second.features, self._vocabulary)
        placed = np.where(views.triangulated != 0, matches, -1).astype(np.int32)
        begun = core.create_monocular_map(
            self._map, first, second, views.T_21, placed, views.points
        )
        if not begun.ok:
            return Reason.INITIAL_MAP_FAILED
        _log.info("new map with %d points", self._map.n_points)
        self._mapping.insert_keyframe(begun.first)
        self._mapping.insert_keyframe(begun.second)
        self.reset()
        return Reason.NONE
