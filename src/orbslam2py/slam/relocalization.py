# SPDX-License-Identifier: BSD-3-Clause
"""Relocalization: the pose of a frame in the map without a guess.

Mur-Artal and Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.front_end import intrinsics

#: RANSAC iterations that each candidate gets per turn.
_ITERATIONS_PER_TURN = 5


@dataclass(frozen=True)
class RelocalizationThresholds:
    """The limits of relocalization; the defaults are the published system's."""

    ratio: float = 0.75
    """Best by second best descriptor distance, matching by words."""
    matches: int = 15
    """Fewest matches by words that make a candidate."""
    inliers: int = 10
    """Fewest inliers of the first pose that are worth widening."""
    enough: int = 50
    """Inliers that make a success."""
    narrow: int = 30
    """More inliers than this, but not enough, are widened once more with a narrow window."""


class _Candidate:
    """A keyframe that looks like the frame: its matches and the RANSAC over them."""

    def __init__(self, keyframe: int, matches: core.TrackedFrame, seed: int) -> None:
        self.keyframe = keyframe
        self.matches = matches
        self.indices = np.flatnonzero(matches.map_points >= 0)
        frame = matches.frame
        self.ransac = core.PnpRansac(
            matches.positions[self.indices],
            frame.keypoints[self.indices].astype(np.float64),
            frame.sigma2[self.indices].astype(np.float64),
            intrinsics(frame.camera),
            seed=seed,
        )


class Relocalizer:
    """Finds a frame in the map.

    Parameters
    ----------
    world : orbslam2py._core.Map
        The map.
    index : orbslam2py._core.KeyFrameIndex
        Which keyframes contain which words.
    seed : int
        Seed of the draws.
    thresholds : RelocalizationThresholds, optional
        Limits.
    """

    def __init__(
        self,
        world: core.Map,
        index: core.KeyFrameIndex,
        seed: int,
        thresholds: RelocalizationThresholds | None = None,
    ) -> None:
        self._map = world
        self._index = index
        self._seed = seed
        self._limits = thresholds or RelocalizationThresholds()

    def relocalize(self, frame: core.TrackedFrame) -> int:
        """Find pose and associations of a described frame.

        Returns
        -------
        int
            Number of inliers; 0 if the frame was not found, and then it has no associations.
        """
        candidates = self._candidates(frame)
        while candidates:
            remaining = []
            for candidate in candidates:
                pose = candidate.ransac.iterate(_ITERATIONS_PER_TURN)
                if pose is not None:
                    n_inliers = self._verify(frame, candidate, pose)
                    if n_inliers >= self._limits.enough:
                        return n_inliers
                if not candidate.ransac.exhausted:
                    remaining.append(candidate)
            candidates = remaining
        frame.clear_associations()
        frame.T_cw = None
        return 0

    def _candidates(self, frame: core.TrackedFrame) -> list[_Candidate]:
        found = core.find_relocalization_candidates(self._index, self._map, frame.frame)
        candidates = []
        for place in found:
            matches = core.TrackedFrame(frame.frame)
            n_matches = core.match_keyframe_by_words(
                self._map, place.keyframe, matches, self._limits.ratio
            )
            if n_matches >= self._limits.matches:
                seed = hash((self._seed, frame.id, place.keyframe)) & 0x7FFFFFFF
                candidates.append(_Candidate(place.keyframe, matches, seed))
        return candidates

    def _verify(self, frame: core.TrackedFrame, candidate: _Candidate, pose: core.PnpPose) -> int:
        """Optimise the pose, add matches by projection; the number of inliers."""
        limits = self._limits
        keep = np.zeros(len(frame.frame), bool)
        keep[candidate.indices[pose.inliers != 0]] = True
        frame.copy_associations(candidate.matches, keep)
        frame.T_cw = pose.T_cw
        n_inliers = self._optimize(frame)
        if n_inliers < limits.inliers or n_inliers >= limits.enough:
            return n_inliers

        n_inliers = self._widen(frame, candidate, n_inliers, radius=10.0, max_distance=100)
        if limits.narrow < n_inliers < limits.enough:
            n_inliers = self._widen(frame, candidate, n_inliers, radius=3.0, max_distance=64)
        return n_inliers

    def _widen(
        self,
        frame: core.TrackedFrame,
        candidate: _Candidate,
        n_inliers: int,
        *,
        radius: float,
        max_distance: int,
    ) -> int:
        ids = frame.map_points
        found = np.unique(ids[ids >= 0])
        added = core.match_keyframe_by_projection(
            self._map, candidate.keyframe, frame, found, radius, max_distance
        )
        if n_inliers + added < self._limits.enough:
            return n_inliers
        return self._optimize(frame)

    @staticmethod
    def _optimize(frame: core.TrackedFrame) -> int:
        estimate = core.optimize_pose(frame)
        frame.discard_outliers()
        return estimate.n_inliers
