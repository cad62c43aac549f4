# SPDX-License-Identifier: BSD-3-Clause
"""The motion between two views, chosen by all views that see the same points.

With little parallax, several motions fit two views, and one third view often agrees with more than
one of them. All views together can decide. ``docs/method/start.md#all-views-together``.
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
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization.third_view import (
    INLIER_CHI2,
    Candidate,
    Motion,
    ThirdViews,
    is_another_direction,
    on_the_way,
    pose_of_view,
    reconstruct,
    squared_errors,
)

_FURTHER_DRAWS = 5  # RANSAC runs whose motions are compared in all views together
_ROUNDS = 2  # of adjustment, each followed by a new triangulation of all matches
_COLLAPSED = 1e-9  # of the way before the adjustment


@dataclass(frozen=True)
class _Sightings:
    """Keypoints of one view that match those of the first view and the last frame.

    Attributes
    ----------
    rows
        Mask of the keypoints with a match in this view, (n,).
    pixels
        Pixels of the keypoints, (n, 2).
    inverse_sigma2
        Weights by the keypoints' levels, (n,) [px^-2].
    """

    rows: np.ndarray
    pixels: FloatArray
    inverse_sigma2: FloatArray

    @staticmethod
    def of(frame: core.Frame, rows: np.ndarray, keypoints: np.ndarray) -> _Sightings:
        """Observations of a frame: one row for each keypoint."""
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


class MultiViewModelSelection:
    """A view that a map may begin from, the last frame, and other views of the same points.

    Parameters
    ----------
    candidate
        The first view, with the motions that other views support.
    thirds
        The other views.
    last
        The frame that would be the second view.
    limits
        Limits.
    """

    def __init__(
        self,
        candidate: Candidate,
        thirds: ThirdViews,
        last: core.Frame,
        limits: InitializationConfig,
    ) -> None:
        self._view = view = candidate.view
        self._last = last
        self._limits = limits
        self._camera = last.camera
        self._keypoints = matched = np.flatnonzero(view.matches >= 0)
        every = np.arange(len(matched))
        self._sightings = [
            _Sightings.of(view.frame, every, matched),
            _Sightings.of(last, every, view.matches[matched]),
        ]
        for third in thirds.views:
            partners = third.partners[matched]
            rows = np.flatnonzero(partners >= 0)
            self._sightings.append(_Sightings.of(third.view.frame, rows, partners[rows]))
        self._fewest_common = thirds.fewest_common

    def best_motion(self, motions: Sequence[Motion], seed: int) -> core.TwoViewMotion | None:
        """Return the motion that fits all views best; None if it is ambiguous.

        Parameters
        ----------
        motions
            The motion that third views support best, and those that fit nearly as well.
        seed
            Of the further samples, which give motions for comparison.
        """
        limits = self._limits
        is_ambiguous = len(motions) > 1
        judged: list[tuple[_Placed, float]] = []
        draws = range(_FURTHER_DRAWS + 1)
        if is_ambiguous:
            judged = side_by_side(self._refined, motions)
            if self._told_apart(judged, is_ambiguous=True) is None:
                return None  # other draws take time, and would not help
            draws = draws[1:]
        # Nothing else is mapped yet, so the other cores are free. The order is that of the draws.
        judge = functools.partial(self._judged, motions, seed)
        judged += itertools.chain.from_iterable(side_by_side(judge, draws))
        chosen = self._told_apart(judged, is_ambiguous=is_ambiguous)
        if chosen is None or chosen.parallax < limits.parallax:
            return None
        return chosen if np.count_nonzero(chosen.triangulated) >= limits.points else None

    def _told_apart(
        self, judged: Sequence[tuple[_Placed, float]], *, is_ambiguous: bool
    ) -> core.TwoViewMotion | None:
        """Return the motion of least cost, if different motions cost clearly more."""
        limits = self._limits
        other, worse = limits.other_direction, limits.clearly_worse_direction
        if is_ambiguous:
            other, worse = limits.same_direction, limits.clearly_worse_alternative
        best, least = min(judged, key=lambda placed_and_cost: placed_and_cost[1])
        for placed, cost in judged:
            if cost < worse * least and is_another_direction(placed.motion, best.motion, other):
                return None
        return best.motion

    def _judged(
        self, motions: Sequence[Motion], seed: int, draw: int
    ) -> list[tuple[_Placed, float]]:
        """Return the result and cost of each motion of a sample; sample 0 has the given motions."""
        drawn = motions
        if draw > 0:
            result = reconstruct(self._view, self._last, seed + draw)
            drawn = [result] if result.success else result.alternatives
        return [self._refined(motion) for motion in drawn]

    # ---- adjustment ------------------------------------------------------------------------------
    def _refined(self, motion: Motion) -> tuple[_Placed, float]:
        """Adjust motion, points and other views' poses while the cost falls; return with the cost.

        With little parallax, an adjustment may end without any valid point. Then the motion before
        the adjustment remains valid.
        """
        placed = self._place(motion.T_21)
        cost = self._cost(placed)
        for _ in range(_ROUNDS):
            adjusted = self._place(*self._adjusted(placed))
            new_cost = self._cost(adjusted)
            if new_cost >= cost:
                break
            placed, cost = adjusted, new_cost
        return placed, cost

    def _place(self, T_21: core.Pose, others: Sequence[core.Pose | None] = ()) -> _Placed:
        """Triangulate all matches by a motion, and estimate the other views' poses from the points.

        The search for a view starts at its assumed pose, or between the first view and the last.
        """
        view = self._view
        motion = core.place_points(
            view.keypoints, self._last.keypoints, view.matches, self._camera, T_21
        )
        points = motion.points[self._keypoints]
        is_placed = motion.triangulated[self._keypoints] != 0
        poses: list[core.Pose | None] = [core.Pose(), motion.T_21]
        anywhere = on_the_way(motion.T_21)
        known = others or [None] * (len(self._sightings) - 2)
        for seen, pose in zip(self._sightings[2:], known, strict=True):
            use = is_placed[seen.rows]
            if np.count_nonzero(use) < self._fewest_common:
                poses.append(None)
                continue
            found, _ = pose_of_view(
                anywhere if pose is None else [pose],
                points[seen.rows[use]],
                seen.pixels[use],
                seen.inverse_sigma2[use],
                self._camera,
            )
            poses.append(found)
        return _Placed(motion, points, is_placed, poses)

    def _adjusted(self, placed: _Placed) -> tuple[core.Pose, list[core.Pose | None]]:
        """Return T_21 and the other views' poses after a bundle adjustment of all views.

        It uses the points so far; the translation between first and last view has length 1.
        """
        unchanged = placed.motion.T_21, placed.poses[2:]
        rows = np.flatnonzero(placed.is_placed)
        if len(rows) < self._fewest_common:
            return unchanged
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
            placed.points[rows],
            np.concatenate(cameras),
            np.concatenate(points),
            uvr,
            np.concatenate(weights),
            options,
        )
        length = np.linalg.norm(adjusted[1].translation)
        if not length > _COLLAPSED:  # nor not a number
            # Views without parallax may end in one place: then the motion does not change.
            return unchanged
        T_21, *others = (core.Pose(T.quaternion_xyzw, T.translation / length) for T in adjusted[1:])
        left = iter(others)
        return T_21, [None if pose is None else next(left) for pose in placed.poses[2:]]

    def _cost(self, placed: _Placed) -> float:
        """Return the mean squared error over all observations, in variances, at most 5.99 each.

        Matches without a point count as wrong; otherwise a motion with few points could fit well. A
        point with so little parallax that it would lie behind the first view is placed at infinity.
        """
        points = placed.points
        first = self._sightings[0]
        rays = self._camera.rays(np.ascontiguousarray(first.pixels, np.float64))
        behind = np.zeros(len(points), bool)
        behind[first.rows] = np.sum(rays * points[first.rows], axis=1) < 0
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
