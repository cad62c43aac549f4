# SPDX-License-Identifier: BSD-3-Clause
"""How the map of a single camera begins: from two views with enough parallax.

Mur-Artal, Montiel and Tardos, 2015, section IV.
"""

from __future__ import annotations

import logging

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.records import Reason

_log = logging.getLogger(__name__)

#: A view must have more keypoints than this.
_MIN_KEYPOINTS = 100
#: Fewest matches between the two views.
_MIN_MATCHES = 100
#: Search window around the position in the first view, pixels.
_WINDOW = 100.0
_RATIO = 0.9

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
    world : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Describes the first keyframes.
    mapping : LocalMapping
        Takes the two first keyframes.
    seed : int
        Seed of the draws.
    """

    def __init__(
        self,
        world: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        seed: int,
    ) -> None:
        self._map = world
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        """Drop the first view."""
        self._first: core.TrackedFrame | None = None
        self._positions = np.zeros((0, 2), np.float32)

    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Begin the map with this frame as second view; or say why not."""
        if frame.frame.size <= _MIN_KEYPOINTS:
            self.reset()
            return Reason.TOO_FEW_KEYPOINTS
        if self._first is None:
            self._first = frame
            self._positions = frame.frame.keypoints
            return Reason.FIRST_VIEW

        first = self._first
        matches, self._positions = core.match_for_initialization(
            first.frame, frame.frame, self._positions, _WINDOW, _RATIO
        )
        if np.count_nonzero(matches >= 0) < _MIN_MATCHES:
            self.reset()
            return Reason.FEW_MATCHES_FIRST_VIEW
        views = core.reconstruct_two_views(
            first.frame.keypoints,
            frame.frame.keypoints,
            matches,
            intrinsics(frame.frame.camera),
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
        core.describe(first.frame, self._vocabulary)
        core.describe(second.frame, self._vocabulary)
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
