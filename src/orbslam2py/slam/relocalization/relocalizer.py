# SPDX-License-Identifier: BSD-3-Clause
"""Relocalization: the pose of a frame in the map, without the frame before.

Mur-Artal and Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014;
``docs/method/relocalization.md``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.slam.config import RelocalizationConfig
from orbslam2py.slam.relocalization.ambiguity_check import AmbiguityCheck
from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.pnp_verification import PnPVerification, optimize
from orbslam2py.slam.state import MOTION_FRAMES, LostSearch

_GUESS_KEYFRAMES = 5  # nearest to a guessed pose, that are tried
_GUESS_COSINE = 0.5  # 60 degrees: largest angle between their viewing direction and the guess's
_GUESSED_FRAMES = 60  # after a loss, in which the last known pose is searched
_WIDENING, _WIDEST = 0.25, 3.0  # growth of its search radius at a failure, and largest multiple


class Relocalization(NamedTuple):
    """The result of the search for a lost frame."""

    n_inliers: int = 0
    """0: not found."""
    is_ambiguous: bool = False
    """Not found, because it fits several places."""


class Relocalizer:
    """Finds a frame in the map; the work for one frame does not grow with the map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    keyframe_index : orbslam2py._core.KeyFrameIndex
        Index from words to keyframes.
    seed : int
        Seed of the draws.
    fix_scale : bool
        Depth is measured: the map has one scale without drift.
    config : RelocalizationConfig
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        keyframe_index: core.KeyFrameIndex,
        seed: int,
        *,
        fix_scale: bool,
        config: RelocalizationConfig,
    ) -> None:
        self._map = slam_map
        self._limits = limits = config
        self._places = CandidatePlaces(slam_map, keyframe_index)
        self._fitting = PnPVerification(slam_map, seed, limits)
        self._rival_places = AmbiguityCheck(
            slam_map, self._places, self._fitting, fix_scale=fix_scale, config=limits
        )

    def relocalize(
        self, frame: core.TrackedFrame, lost: LostSearch
    ) -> tuple[Relocalization, LostSearch]:
        """Estimate pose and associations of a frame with words.

        Search near the last known pose first, if there is one, then at keyframes that look like the
        frame.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame. If it is not found, it has no associations.
        lost : LostSearch
            State of the search in earlier frames.

        Returns
        -------
        Relocalization
            Found or not.
        LostSearch
            For the next frame.
        """
        found, lost = self._near_loss(frame, lost)
        if found.n_inliers == 0:
            found, lost = self._by_likeness(frame, lost)
        if found.n_inliers == 0:
            lost = replace(lost, failures=lost.failures + 1)
        return found, lost

    def _near_loss(
        self, frame: core.TrackedFrame, lost: LostSearch
    ) -> tuple[Relocalization, LostSearch]:
        limits = self._limits
        place = lost.place
        if place is None or frame.id - place.last.id > _GUESSED_FRAMES:
            return Relocalization(), lost
        place = place.following(self._map)
        lost = replace(lost, place=place)
        ids = np.array(place.keyframes(self._map), np.int64)
        T_wc = np.array([self._map.keyframe_pose(k).inverse().matrix for k in ids])
        wider = min(1 + _WIDENING * lost.failures, _WIDEST)
        just_lost = frame.id - place.last.id <= MOTION_FRAMES
        enough = limits.narrow if just_lost else limits.enough
        for guess in place.guesses(frame):
            nearest = self._nearest(guess, ids, T_wc)
            n_inliers = self._near(frame, guess, nearest, wider, enough)
            if n_inliers > 0:
                return Relocalization(n_inliers), lost
        return Relocalization(), lost

    def _by_likeness(
        self, frame: core.TrackedFrame, lost: LostSearch
    ) -> tuple[Relocalization, LostSearch]:
        keyframes, lost = self._places.of(frame.features, lost)
        candidates = self._fitting.matched(frame, keyframes)
        found = self._fitting.first_that_fits(frame, candidates, self._limits.enough)
        is_ambiguous = False
        if found is not None:
            first, n_inliers = found
            best = self._rival_places.choose(frame, first.keyframe, candidates)
            if best is frame:
                return Relocalization(n_inliers), lost
            if best is not None:
                frame.take_over(best)
                return Relocalization(frame.n_associated()), lost
            is_ambiguous = True
        frame.clear_associations()
        frame.T_cw = None
        return Relocalization(is_ambiguous=is_ambiguous), lost

    def relocalize_near(self, frame: core.TrackedFrame, T_cw: core.Pose) -> int:
        """Estimate pose and associations of a frame near a guess, without words.

        Search the points of the nearest keyframes with a similar viewing direction around their
        pixels by the guess.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        T_cw : Pose
            The guess.

        Returns
        -------
        int
            Number of inliers; 0 if the frame was not found, and then it has no associations.
        """
        every = core.snapshot_keyframes(self._map)
        nearest = self._nearest(T_cw, every.ids, every.T_wc)
        return self._near(frame, T_cw, nearest, 1.0, self._limits.enough)

    def compare_with(self, frame: core.TrackedFrame, keyframes: list[int]) -> int:
        """Estimate pose and associations by comparing all keypoints with those of likely keyframes.

        It needs no words and no guess: points are matched by their descriptors alone, and RANSAC
        rejects wrong matches.

        Returns
        -------
        int
            Number of inliers, at least `RelocalizationConfig.inliers`; 0 if the frame was not
            found, and then it has no associations.
        """
        candidates = self._fitting.matched(frame, keyframes, thoroughly=True)
        found = self._fitting.first_that_fits(frame, candidates, self._limits.inliers)
        if found is not None:
            return found[1]
        frame.clear_associations()
        frame.T_cw = None
        return 0

    def _near(
        self,
        frame: core.TrackedFrame,
        T_cw: core.Pose,
        keyframes: list[int],
        wider: float,
        enough: int,
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
                limits.narrow_distance,
            )
            if n_matches < limits.matches or optimize(frame) < limits.inliers:
                continue
            # Again from the better pose, in a narrower window.
            found = np.unique(frame.map_points[frame.map_points >= 0])
            core.match_keyframe_by_projection(
                self._map, keyframe, frame, found, limits.wide_window, limits.wide_distance
            )
            n_inliers = optimize(frame)
            if n_inliers >= enough:
                return n_inliers
        frame.clear_associations()
        frame.T_cw = None
        return 0

    def _nearest(self, T_cw: core.Pose, ids: IntArray, T_wc: FloatArray) -> list[int]:
        """Return the nearest keyframes (k,) with similar directions, and poses (k, 4, 4)."""
        if not len(ids):
            return []
        guess = T_cw.inverse().matrix
        distances = np.linalg.norm(T_wc[:, :3, 3] - guess[:3, 3], axis=1)
        # The optical axes; a camera in the opposite direction sees other points.
        cosines = T_wc[:, :3, 2] @ guess[:3, 2]
        distances[cosines < _GUESS_COSINE] = np.inf
        nearest = np.argsort(distances, kind="stable")[:_GUESS_KEYFRAMES]
        return [int(ids[i]) for i in nearest if np.isfinite(distances[i])]
