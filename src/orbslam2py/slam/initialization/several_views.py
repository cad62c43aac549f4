# SPDX-License-Identifier: BSD-3-Clause
"""The motion between two views by all views that see the same points: what a map begins with.

Two views with little parallax fit more than one motion, a matrix from eight of their matches may
give any of them, and one third view agrees with many. All views together tell them apart.
``docs/method/start.md#all-views-together``.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py._cores import side_by_side
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.initialization.kept_views import View
from orbslam2py.slam.initialization.third_view import (
    FEWEST_COMMON,
    INLIER_CHI2,
    Candidate,
    Motion,
    is_another_direction,
    other_views,
    pose_of_view,
    reconstruct,
    squared_errors,
)
from orbslam2py.slam.thresholds import InitializationThresholds

_ROUNDS = 2  # of adjustment, each followed by placing all matches anew


@dataclass(frozen=True)
class _Sightings:
    """Where one view sees the keypoints of the first view that the last frame sees too.

    Attributes
    ----------
    rows
        Which of these keypoints it sees, (n,).
    pixels
        Where, (n, 2).
    inverse_sigma2
        Weights by the keypoints' levels, (n,) [px^-2].
    """

    rows: np.ndarray
    pixels: FloatArray
    inverse_sigma2: FloatArray

    @staticmethod
    def of(frame: core.Frame, rows: np.ndarray, keypoints: np.ndarray) -> _Sightings:
        """What a frame sees: its keypoint per row."""
        return _Sightings(
            rows,
            frame.keypoints[keypoints].astype(np.float64),
            1 / frame.sigma2[keypoints].astype(np.float64),
        )


@dataclass(frozen=True)
class _Placed:
    """Points of all matched keypoints, and the poses of all views: first, last, others."""

    motion: core.TwoViewMotion
    points: FloatArray
    is_placed: np.ndarray
    poses: list[core.Pose | None]


class SeveralViews:
    """A view that a map may begin from, the last frame, and the other views of the same things.

    Parameters
    ----------
    candidate
        The first view, with a motion that other views agree with.
    views
        All views kept.
    last
        The frame that would be the second view.
    limits
        Limits.
    """

    def __init__(
        self,
        candidate: Candidate,
        views: Sequence[View],
        last: core.Frame,
        limits: InitializationThresholds,
    ) -> None:
        self._view = view = candidate.view
        self._last = last
        self._limits = limits
        self._camera = intrinsics(last.camera)
        self._keypoints = matched = np.flatnonzero(view.matches >= 0)
        every = np.arange(len(matched))
        self._sightings = [
            _Sightings.of(view.frame, every, matched),
            _Sightings.of(last, every, view.matches[matched]),
        ]
        for third in other_views(view, views, limits):
            partners = view.partners(third)[matched]
            rows = np.flatnonzero(partners >= 0)
            self._sightings.append(_Sightings.of(third.frame, rows, partners[rows]))

    def best_motion(self, motion: Motion, seed: int) -> core.TwoViewMotion | None:
        """The motion that all views agree with best; None if they do not tell it from another.

        Parameters
        ----------
        motion
            The one that was found.
        seed
            Of the further draws that give others to compare with.
        """
        draws = range(self._limits.further_draws + 1)
        # Nothing else is mapped yet, so the other cores are free. The order is that of the draws.
        judge = functools.partial(self._judged, motion, seed)
        judged = list(itertools.chain.from_iterable(side_by_side(judge, draws)))
        found, costs = [placed for placed, _ in judged], [cost for _, cost in judged]
        best = int(np.argmin(costs))
        chosen = found[best].motion
        enough = self._limits.clearly_worse_direction * costs[best]
        for placed, cost in zip(found, costs, strict=True):
            other = self._limits.other_direction
            if cost < enough and is_another_direction(placed.motion, chosen, other):
                return None
        n_points = np.count_nonzero(chosen.triangulated)
        if chosen.parallax < self._limits.parallax or n_points < self._limits.points:
            return None
        return chosen

    def _judged(self, motion: Motion, seed: int, draw: int) -> list[tuple[_Placed, float]]:
        """What comes of each motion of a draw, with its cost; draw 0 is the motion given."""
        found = [self._refined(other) for other in self._drawn(motion, seed, draw)]
        return [(placed, self._cost(placed)) for placed in found]

    def _drawn(self, motion: Motion, seed: int, draw: int) -> Sequence[Motion]:
        if draw == 0:
            return [motion]
        result = reconstruct(self._view, self._last, seed + draw)
        return [result] if result.success else result.alternatives

    # ---- adjustment ------------------------------------------------------------------------------
    def _refined(self, motion: Motion) -> _Placed:
        """Adjust motion, points and the other views' poses; place all matches by the result."""
        placed = self._place(motion.T_21)
        for _ in range(_ROUNDS):
            placed = self._place(self._adjusted(placed))
        return placed

    def _place(self, T_21: core.Pose) -> _Placed:
        view = self._view
        motion = core.place_points(
            view.keypoints, self._last.keypoints, view.matches, self._camera, T_21
        )
        points = motion.points[self._keypoints]
        is_placed = motion.triangulated[self._keypoints] != 0
        poses: list[core.Pose | None] = [core.Pose(), motion.T_21]
        for seen in self._sightings[2:]:
            use = is_placed[seen.rows]
            if np.count_nonzero(use) < FEWEST_COMMON:
                poses.append(None)
                continue
            pose, _ = pose_of_view(
                motion.T_21,
                points[seen.rows[use]],
                seen.pixels[use],
                seen.inverse_sigma2[use],
                self._camera,
            )
            poses.append(pose)
        return _Placed(motion, points, is_placed, poses)

    def _adjusted(self, placed: _Placed) -> core.Pose:
        """T_21 after a bundle adjustment of all views and the points placed so far."""
        rows = np.flatnonzero(placed.is_placed)
        if len(rows) < FEWEST_COMMON:
            return placed.motion.T_21
        number = np.full(len(placed.is_placed), -1, np.int64)
        number[rows] = np.arange(len(rows))
        poses: list[core.Pose] = []
        cameras, points, pixels, weights = [], [], [], []
        for pose, seen in zip(placed.poses, self._sightings, strict=True):
            if pose is None:
                continue
            use = number[seen.rows] >= 0
            cameras.append(np.full(np.count_nonzero(use), len(poses), np.int64))
            points.append(number[seen.rows[use]])
            pixels.append(seen.pixels[use])
            weights.append(seen.inverse_sigma2[use])
            poses.append(pose)
        n = sum(map(len, points))
        uvr = np.full((n, 3), np.nan)
        uvr[:, :2] = np.concatenate(pixels)
        options = core.BundleOptions()
        options.robust_iterations, options.final_iterations = 20, 10
        adjusted, _, _ = core.solve_bundle(
            poses,
            [True] + [False] * (len(poses) - 1),
            self._camera,
            0.0,
            placed.points[rows],
            np.concatenate(cameras),
            np.concatenate(points),
            uvr,
            np.concatenate(weights),
            options,
        )
        T_21: core.Pose = adjusted[1]
        # Views without parallax may end in one place: then the motion stays what it was.
        return T_21 if np.linalg.norm(T_21.translation) > 0 else placed.motion.T_21

    def _cost(self, placed: _Placed) -> float:
        """Mean squared error over everything seen, in units of its variance, at most 5.99 each.

        What the two views place nowhere counts as wrong, or few points could fit well. What has so
        little parallax that it would lie behind the first view is taken to be infinitely far.
        """
        points = placed.points
        behind = points[:, 2] < 0
        nowhere = np.all(points == 0, axis=1)
        costs = []
        for pose, seen in zip(placed.poses, self._sightings, strict=True):
            chi2 = np.full(len(seen.rows), INLIER_CHI2)
            if pose is not None:
                turn = core.Pose(pose.quaternion_xyzw, np.zeros(3))
                for T_cw, here, sign in ((pose, ~behind, 1.0), (turn, behind, -1.0)):
                    use = (here & ~nowhere)[seen.rows]
                    errors = squared_errors(
                        T_cw,
                        sign * points[seen.rows[use]],
                        seen.pixels[use],
                        seen.inverse_sigma2[use],
                        self._camera,
                    )
                    chi2[use] = np.minimum(errors, INLIER_CHI2)
            costs.append(chi2)
        return float(np.mean(np.concatenate(costs)))
