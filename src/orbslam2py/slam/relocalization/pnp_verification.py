# SPDX-License-Identifier: BSD-3-Clause
"""Pose of a lost frame by one of several keyframes: matches by words, RANSAC, more matches.

Mur-Artal and Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014;
``docs/method/relocalization.md``.
"""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.config import RelocalizationConfig

_THOROUGH_RATIO = 0.85  # of best to second best distance, where all keypoints are compared
_THOROUGH_MATCHES = 12  # fewest matches then
_VERIFIED_POSES = 20  # most RANSAC poses that are optimised for one frame: bounds its time


def optimize(frame: core.TrackedFrame) -> int:
    """Optimise a pose and drop the outliers; return the number of inliers."""
    estimate = core.optimize_pose(frame)
    frame.discard_outliers()
    return estimate.n_inliers


class Candidate:
    """A keyframe that looks like the frame, with its matches and its RANSAC."""

    def __init__(self, keyframe: int, matches: core.TrackedFrame, seed: int) -> None:
        self.keyframe = keyframe
        self.matches = matches
        self.indices = np.flatnonzero(matches.map_points >= 0)
        features = matches.features
        self.ransac = core.PnpRansac(
            matches.positions[self.indices],
            features.keypoints[self.indices].astype(np.float64),
            features.sigma2[self.indices].astype(np.float64),
            features.camera,
            seed=seed,
        )


class PnPVerification:
    """Fits frames to keyframes.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    seed : int
        Seed of the draws.
    config : RelocalizationConfig
        Limits.
    """

    def __init__(self, slam_map: core.Map, seed: int, config: RelocalizationConfig) -> None:
        self._map = slam_map
        self._seed = seed % 2**64
        self._limits = config

    def matched(
        self, frame: core.TrackedFrame, keyframes: list[int], *, thoroughly: bool = False
    ) -> list[Candidate]:
        """Return those keyframes that have enough matches by words with a frame.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame, with words, unless `thorough` is set.
        keyframes : list of int
            Ids.
        thoroughly : bool
            Without words: compare every point with every keypoint, which takes longer.
        """
        limits = self._limits
        match, ratio, fewest = core.match_keyframe_by_words, limits.ratio, limits.matches
        if thoroughly:
            match = core.match_keyframe_by_descriptors
            ratio, fewest = _THOROUGH_RATIO, _THOROUGH_MATCHES
        candidates = []
        for keyframe in keyframes:
            matches = core.TrackedFrame(frame.features)
            n_matches = match(self._map, keyframe, matches, ratio)
            if n_matches >= fewest:
                seed = core.seed_of(self._seed, frame.id, keyframe)
                candidates.append(Candidate(keyframe, matches, seed))
        return candidates

    def first_that_fits(
        self, frame: core.TrackedFrame, candidates: list[Candidate], enough: int
    ) -> tuple[Candidate, int] | None:
        """Return the candidate that gives the frame a pose, and its inliers."""
        limits = self._limits
        n_verified = 0
        while candidates and n_verified < _VERIFIED_POSES:
            remaining = []
            for candidate in candidates:
                pose = candidate.ransac.iterate(limits.iterations)
                if pose is not None and n_verified < _VERIFIED_POSES:
                    n_verified += 1
                    n_inliers = self._verify(frame, candidate, pose)
                    if n_inliers >= enough:
                        return candidate, n_inliers
                if not candidate.ransac.exhausted:
                    remaining.append(candidate)
            candidates = remaining
        return None

    def _verify(self, frame: core.TrackedFrame, candidate: Candidate, pose: core.PnpPose) -> int:
        """Optimise the pose, add matches by projection; return the number of inliers."""
        limits = self._limits
        keep = np.zeros(len(frame.features), bool)
        keep[candidate.indices[pose.inliers != 0]] = True
        frame.copy_associations(candidate.matches, keep)
        frame.T_cw = pose.T_cw
        n_inliers = optimize(frame)
        if n_inliers < limits.inliers or n_inliers >= limits.enough:
            return n_inliers

        n_inliers = self._widen(
            frame, candidate, n_inliers, limits.wide_window, limits.wide_distance
        )
        if limits.narrow < n_inliers < limits.enough:
            n_inliers = self._widen(
                frame, candidate, n_inliers, limits.narrow_window, limits.narrow_distance
            )
        return n_inliers

    def _widen(
        self,
        frame: core.TrackedFrame,
        candidate: Candidate,
        n_inliers: int,
        window: float,
        max_distance: int,
    ) -> int:
        ids = frame.map_points
        found = np.unique(ids[ids >= 0])
        added = core.match_keyframe_by_projection(
            self._map, candidate.keyframe, frame, found, window, max_distance
        )
        if n_inliers + added < self._limits.enough:
            return n_inliers
        return optimize(frame)
