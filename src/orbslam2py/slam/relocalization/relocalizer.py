# SPDX-License-Identifier: BSD-3-Clause
"""Relocalization: the pose of a frame in the map when the frame before has none.

Mur-Artal and Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014;
``docs/method/relocalization.md``.
"""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.place_of_loss import PlaceOfLoss
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
    """Finds a frame in the map, with work for one frame that does not grow with the map.

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
        self._seed = seed % 2**64
        self._limits = limits = thresholds or RelocalizationThresholds()
        self._places = CandidatePlaces(slam_map, keyframe_index, limits)
        self.reset()

    def reset(self) -> None:
        """Forget where tracking was lost: it was found, or the map is another one."""
        self._place: PlaceOfLoss | None = None
        self._failures = 0
        self._places.reset()

    def lose(self, place: PlaceOfLoss) -> None:
        """Take where tracking was lost; it is searched from there, wider at every failure."""
        self.reset()
        self._place = place

    def relocalize(self, frame: core.TrackedFrame) -> int:
        """Find pose and associations of a described frame.

        Where tracking was lost is searched first, if it is known, then keyframes that look alike.

        Returns
        -------
        int
            Number of inliers; 0 if the frame was not found, and then it has no associations.
        """
        n_inliers = self._near_loss(frame)
        if n_inliers == 0:
            n_inliers = self._by_likeness(frame)
        self._failures += n_inliers == 0
        return n_inliers

    def _near_loss(self, frame: core.TrackedFrame) -> int:
        limits = self._limits
        place = self._place
        if place is None or frame.id - place.last.id > limits.guessed_frames:
            return 0
        place.follow_map(self._map)
        ids = np.array(place.keyframes(self._map, limits), np.int64)
        T_wc = np.array([self._map.keyframe_pose(k).inverse().matrix for k in ids])
        wider = min(1 + limits.widening * self._failures, limits.widest)
        for guess in place.guesses(frame.id, limits):
            n_inliers = self._near(frame, guess, self._nearest(guess, ids, T_wc), wider)
            if n_inliers > 0:
                return n_inliers
        return 0

    def _by_likeness(self, frame: core.TrackedFrame) -> int:
        limits = self._limits
        candidates = self._candidates(frame)
        n_verified = 0
        while candidates and n_verified < limits.verified_poses:
            remaining = []
            for candidate in candidates:
                pose = candidate.ransac.iterate(limits.iterations)
                if pose is not None and n_verified < limits.verified_poses:
                    n_verified += 1
                    n_inliers = self._verify(frame, candidate, pose)
                    if n_inliers >= limits.enough:
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
        every = core.snapshot_keyframes(self._map)
        return self._near(frame, T_cw, self._nearest(T_cw, every.ids, every.T_wc), 1.0)

    def _near(
        self, frame: core.TrackedFrame, T_cw: core.Pose, keyframes: list[int], wider: float
    ) -> int:
        limits = self._limits
        nothing = np.zeros(0, np.int64)
        for keyframe in keyframes:
            frame.clear_associations()
            frame.T_cw = T_cw
            n_matches = core.match_keyframe_by_projection(
                self._map,
                keyframe,
                frame,
                nothing,
                wider * limits.guess_window,
                limits.guess_distance,
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

    def _nearest(self, T_cw: core.Pose, ids: IntArray, T_wc: FloatArray) -> list[int]:
        """The keyframes (k,) with poses (k, 4, 4) that are nearest and look the same way."""
        if not len(ids):
            return []
        guess = T_cw.inverse().matrix
        distances = np.linalg.norm(T_wc[:, :3, 3] - guess[:3, 3], axis=1)
        # The optical axes; whoever looks the other way sees other points.
        cosines = T_wc[:, :3, 2] @ guess[:3, 2]
        distances[cosines < self._limits.guess_cosine] = np.inf
        nearest = np.argsort(distances, kind="stable")[: self._limits.guess_keyframes]
        return [int(ids[i]) for i in nearest if np.isfinite(distances[i])]

    def _candidates(self, frame: core.TrackedFrame) -> list[_Candidate]:
        candidates = []
        for keyframe in self._places.of(frame.features, self._place, self._failures):
            matches = core.TrackedFrame(frame.features)
            n_matches = core.match_keyframe_by_words(
                self._map, keyframe, matches, self._limits.ratio
            )
            if n_matches >= self._limits.matches:
                seed = core.seed_of(self._seed, frame.id, keyframe)
                candidates.append(_Candidate(keyframe, matches, seed))
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
