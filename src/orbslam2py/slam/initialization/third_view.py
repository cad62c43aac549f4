# SPDX-License-Identifier: BSD-3-Clause
"""Third views: test a motion between two views by other views."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization.image_motion import Pixels
from orbslam2py.slam.initialization.initial_views import Indices, InitialViews, View

Motion: TypeAlias = core.TwoViewResult | core.TwoViewMotion

#: Limit of squared errors over their variance: 95 %, two degrees of freedom.
INLIER_CHI2 = 5.991
_FEWER = 2 / 3  # of the points that a third view must see, where no view sees as many
_MOST_PARALLAX = 5.0  # degrees that count: more does not make a better start


@dataclass(frozen=True)
class Candidate:
    """A view that the map could begin from, with the last frame as second view.

    Attributes
    ----------
    view
        The first view.
    motions
        Possible motions between the two: one, or those that two views cannot distinguish.
    """

    view: View
    motions: tuple[Motion, ...]

    @staticmethod
    def of(view: View, result: core.TwoViewResult) -> Candidate | None:
        """Return the motions of two views; None if there are none."""
        if result.success:
            return Candidate(view, (result,))
        return Candidate(view, tuple(result.alternatives)) if result.alternatives else None

    @property
    def is_clear(self) -> bool:
        """Return whether two views alone determine the motion."""
        return len(self.motions) == 1

    @property
    def worth(self) -> float:
        """Points times parallax [degrees]: a larger product determines the geometry better."""
        return max(
            float(np.count_nonzero(placed_matches(self.view, motion) >= 0))
            * min(motion.parallax, _MOST_PARALLAX)
            for motion in self.motions
        )


def reconstruct(view: View, last: core.Frame, seed: int) -> core.TwoViewResult:
    """Return the motion from a view to the last frame, by their matches alone."""
    return core.reconstruct_two_views(
        view.keypoints,
        last.keypoints,
        view.matches,
        last.camera,
        seed=seed,
        # Each model takes about a millisecond: a busy machine starts a thread no sooner.
        two_threads=False,
    )


def placed_matches(view: View, motion: Motion) -> Indices:
    """Return per keypoint of a view its index in the last frame, -1 if it has no point."""
    return np.where(motion.triangulated != 0, view.matches, -1).astype(np.int32)


@dataclass(frozen=True)
class ThirdView:
    """A further view, beside the candidate's.

    Attributes
    ----------
    view
        The view.
    partners
        Per keypoint of the candidate's view the matching keypoint, -1 for none.
    """

    view: View
    partners: Indices


@dataclass(frozen=True)
class ThirdViews:
    """Views that can test a candidate's motions.

    Attributes
    ----------
    views
        The views.
    fewest_common
        Number of the candidate's points that each of them must see.
    """

    views: tuple[ThirdView, ...]
    fewest_common: int

    @staticmethod
    def of(candidate: Candidate, kept: InitialViews, limits: InitializationConfig) -> ThirdViews:
        """Return the views that show most of the last frame; if there are none, the remaining ones.

        With few images a second, three images share few points. Then views that could not begin a
        map are used too, with the matches stored when one of the two was the last frame.
        """
        view = candidate.view
        others = [third for third in kept.views if third is not view]
        near = [
            ThirdView(third, view.partners(third))
            for third in others
            if _moved(third, view, limits)
        ]
        thirds = ThirdViews(tuple(near), limits.third_view_points)
        if any(thirds.asks(candidate, third) for third in near):
            return thirds
        others = [third for third in (*kept.distant, *kept.views) if third is not view]
        every = (ThirdView(third, view.all_partners(third)) for third in others)
        afar = tuple(third for third in every if _lies_between(third, view, limits))
        return ThirdViews(afar, round(_FEWER * limits.third_view_points))

    def asks(self, candidate: Candidate, third: ThirdView) -> bool:
        """Return whether a view sees enough of the points of each motion."""
        seen = third.partners >= 0
        return all(
            np.count_nonzero(seen & (placed_matches(candidate.view, motion) >= 0))
            >= self.fewest_common
            for motion in candidate.motions
        )


def _moved(third: View, view: View, limits: InitializationConfig) -> bool:
    """Return whether a view is far enough from another one and from the last frame."""
    between = min(third.displacement, abs(view.displacement - third.displacement))
    return between >= limits.third_view_share * view.displacement


def _lies_between(third: ThirdView, view: View, limits: InitializationConfig) -> bool:
    """Return the same for the points of all three views, which are distant and move less."""
    common = np.flatnonzero((view.matches >= 0) & (third.partners >= 0))
    if not len(common):
        return False
    first, last = view.keypoints[common], view.positions[common]
    there = third.view.keypoints[third.partners[common]]
    between = min(_median_distance(first, there), _median_distance(there, last))
    return between >= limits.third_view_share * _median_distance(first, last)


def _median_distance(here: Pixels, there: Pixels) -> float:
    return float(np.median(np.linalg.norm(there - here, axis=1)))


def three_view_consistency(
    candidate: Candidate, thirds: ThirdViews, last: core.Frame, limits: InitializationConfig
) -> tuple[Motion, ...]:
    """Return the motion that most other views support, and those that fit nearly as well.

    Return no motion if the other views do not agree or cannot decide. If several motions remain,
    the best one fits only slightly better than those in other directions.
    """
    asked = np.array(
        [
            _verdicts(candidate, third, last)
            for third in thirds.views
            if thirds.asks(candidate, third)
        ]
    )
    if not len(asked):
        return ()
    shares, costs = np.moveaxis(asked, -1, 0)  # (views, motions)
    mean_costs = costs.mean(axis=0)
    best = int(np.argmin(mean_costs))
    if 2 * np.count_nonzero(shares[:, best] >= limits.third_view_fits) <= len(asked):
        return ()
    if candidate.motions[best].parallax < limits.parallax:
        return ()
    chosen = candidate.motions[best]
    enough = limits.clearly_worse * mean_costs[best]
    others = [
        motion
        for motion, cost in zip(candidate.motions, mean_costs, strict=True)
        if cost < enough and is_another_direction(motion, chosen, limits.same_direction)
    ]
    return (chosen, *others)


def is_another_direction(motion: Motion, other: Motion, degrees: float) -> bool:
    """Return whether the directions of two motions differ by more than these degrees.

    In a motion straight towards a wall, both solutions are nearly equal, and only noise separates
    them.
    """
    cosine = float(motion.T_21.translation @ other.T_21.translation)  # both of length 1
    return cosine < math.cos(math.radians(degrees))


def _verdicts(candidate: Candidate, third: ThirdView, last: core.Frame) -> FloatArray:
    """Return how well a third view fits each motion, (motions, 2).

    First the share of common points seen at the predicted pixels, then their mean squared distance
    from there, in variances, at most 5.99 each.
    """
    view, partners = third.view, third.partners
    verdicts = []
    for motion in candidate.motions:
        placed = placed_matches(candidate.view, motion) >= 0
        common = np.flatnonzero(placed & (partners >= 0))
        seen = partners[common]
        _, chi2 = pose_of_view(
            on_the_way(motion.T_21),
            motion.points[common],
            view.keypoints[seen],
            1 / view.frame.sigma2[seen],
            last.camera,
        )
        verdicts.append([np.mean(chi2 < INLIER_CHI2), np.mean(np.minimum(chi2, INLIER_CHI2))])
    return np.array(verdicts)


def on_the_way(T_21: core.Pose) -> list[core.Pose]:
    """Return possible poses of a view between the first view and the last."""
    return [T_21.power(share) for share in (0.5, 0.0, 1.0)]


def pose_of_view(
    starts: Sequence[core.Pose],
    points: FloatArray,
    keypoints: npt.NDArray[np.floating],
    inverse_sigma2: npt.NDArray[np.floating],
    camera: core.Camera,
) -> tuple[core.Pose, FloatArray]:
    """Return the pose of a view that sees points, and their squared errors (n,) in variances.

    Parameters
    ----------
    starts
        Initial poses of the estimation; the best result is used.
    points
        (n, 3), in the frame of the first view.
    keypoints
        Pixels of the points in the view, (n, 2).
    inverse_sigma2
        (n,) [px^-2].
    camera
        That sees.
    """
    points = np.ascontiguousarray(points)
    pixels = np.full((len(points), 3), np.nan)
    pixels[:, :2] = keypoints
    poses, errors = [], []
    for start in starts:
        found = core.optimize_pose(start, camera, points, pixels, inverse_sigma2)
        poses.append(found.T_cw)
        errors.append(squared_errors(found.T_cw, points, keypoints, inverse_sigma2, camera))
    best = int(np.argmin([np.minimum(chi2, INLIER_CHI2).sum() for chi2 in errors]))
    return poses[best], errors[best]


def squared_errors(
    T_cw: core.Pose,
    points: FloatArray,
    keypoints: npt.NDArray[np.floating],
    inverse_sigma2: npt.NDArray[np.floating],
    camera: core.Camera,
) -> FloatArray:
    """Return squared distances (n,) of points (n, 3) from their pixels, over the variance.

    Infinite where the camera cannot see a point.
    """
    positions = np.ascontiguousarray(T_cw @ np.ascontiguousarray(points))
    error = camera.errors(positions, np.ascontiguousarray(keypoints, np.float64))
    chi2 = np.sum(error**2, axis=1) * inverse_sigma2
    return np.where(np.isnan(chi2), np.inf, chi2)
