# SPDX-License-Identifier: BSD-3-Clause
"""Relocalization: the pose of a frame in the map without a guess.

Mur-Artal and Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014;
``docs/method/relocalization.md``.
"""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.thresholds import RelocalizationThresholds


class _Candidate:
    """A keyframe that looks like the frame: its matches and the RANSAC over them."""

    def __init__(self, keyframe: int, matches: core.TrackedFrame, seed: int) -> None:
        self.keyframe = keyframe
        self.matches = matches
        self.indices = np.flatnonzero(matches.map_points >= 0)
        features = matches.features
        self.ransac = core.PnpRansac(
            matches.positions[self.indices],
            features.keypoints[self.indices].astype(np.float64),
            features.sigma2[self.indices].astype(np.float64),
            intrinsics(features.camera),
            seed=seed,
        )


class Relocalizer:
    """Finds a frame in the map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    keyframe_index : orbslam2py._core.KeyFrameIndex
        Which keyframes contain which words.
    seed : int
        Seed of the draws.
    thresholds : RelocalizationThresholds, optional
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        keyframe_index: core.KeyFrameIndex,
        seed: int,
        thresholds: RelocalizationThresholds | None = None,
    ) -> None:
        self._map = slam_map
        self._keyframe_index = keyframe_index
        self._seed = seed % 2**64
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
                pose = candidate.ransac.iterate(self._limits.iterations)
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

    def relocalize_near(self, frame: core.TrackedFrame, T_cw: core.Pose) -> int:
        """Find pose and associations of a frame near a guess, without words.

        The points of the nearest keyframes that look the same way are searched where the guess
        puts them.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        T_cw : Pose
            The guess.

        Returns
        -------
        int
            As for `relocalize`.
        """
        limits = self._limits
        nothing = np.zeros(0, np.int64)
        for keyframe in self._keyframes_near(T_cw):
            frame.clear_associations()
            frame.T_cw = T_cw
            n_matches = core.match_keyframe_by_projection(
                self._map, keyframe, frame, nothing, limits.guess_window, limits.guess_distance
            )
            if n_matches < limits.matches or self._optimize(frame) < limits.inliers:
                continue
            # Again from the better pose, in a narrower window.
            found = np.unique(frame.map_points[frame.map_points >= 0])
            core.match_keyframe_by_projection(
                self._map, keyframe, frame, found, limits.wide_window, limits.wide_distance
            )
            n_inliers = self._optimize(frame)
            if n_inliers >= limits.enough:
                return n_inliers
        frame.clear_associations()
        frame.T_cw = None
        return 0

    def _keyframes_near(self, T_cw: core.Pose) -> list[int]:
        keyframes = core.snapshot_keyframes(self._map)
        T_wc = T_cw.inverse().matrix
        distances = np.linalg.norm(keyframes.T_wc[:, :3, 3] - T_wc[:3, 3], axis=1)
        # The optical axes; whoever looks the other way sees other points.
        cosines = keyframes.T_wc[:, :3, 2] @ T_wc[:3, 2]
        distances[cosines < self._limits.guess_cosine] = np.inf
        nearest = np.argsort(distances, kind="stable")[: self._limits.guess_keyframes]
        return [int(keyframes.ids[i]) for i in nearest if np.isfinite(distances[i])]

    def _candidates(self, frame: core.TrackedFrame) -> list[_Candidate]:
        found = core.find_relocalization_candidates(self._keyframe_index, self._map, frame.features)
        candidates = []
        for place in found:
            matches = core.TrackedFrame(frame.features)
            n_matches = core.match_keyframe_by_words(
                self._map, place.keyframe, matches, self._limits.ratio
            )
            if n_matches >= self._limits.matches:
                seed = core.seed_of(self._seed, frame.id, place.keyframe)
                candidates.append(_Candidate(place.keyframe, matches, seed))
        return candidates

    def _verify(self, frame: core.TrackedFrame, candidate: _Candidate, pose: core.PnpPose) -> int:
        """Optimise the pose, add matches by projection; the number of inliers."""
        limits = self._limits
        keep = np.zeros(len(frame.features), bool)
        keep[candidate.indices[pose.inliers != 0]] = True
        frame.copy_associations(candidate.matches, keep)
        frame.T_cw = pose.T_cw
        n_inliers = self._optimize(frame)
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
        candidate: _Candidate,
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
        return self._optimize(frame)

    @staticmethod
    def _optimize(frame: core.TrackedFrame) -> int:
        estimate = core.optimize_pose(frame)
        frame.discard_outliers()
        return estimate.n_inliers
