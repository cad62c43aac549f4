# SPDX-License-Identifier: BSD-3-Clause
"""What other views say of a motion that was found between two."""

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
        What may have happened between the two: one motion, or those that two views cannot tell
        apart.
    """

    view: View
    motions: tuple[Motion, ...]

    @staticmethod
    def of(view: View, result: core.TwoViewResult) -> Candidate | None:
        """What two views gave; None if they gave no motion."""
        if result.success:
            return Candidate(view, (result,))
        return Candidate(view, tuple(result.alternatives)) if result.alternatives else None

    @property
    def is_clear(self) -> bool:
        """Whether two views are enough to tell the motion."""
        return len(self.motions) == 1

    @property
    def worth(self) -> float:
        """Points times parallax [degrees]: more of either fixes the geometry better."""
        return max(
            float(np.count_nonzero(placed_matches(self.view, motion) >= 0))
            * min(motion.parallax, _MOST_PARALLAX)
            for motion in self.motions
        )


def reconstruct(view: View, last: core.Frame, seed: int) -> core.TwoViewResult:
    """The motion from a view to the last frame, by the matches between the two alone."""
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
    """Per keypoint of a view the index in the last frame, -1 where no point was placed."""
    return np.where(motion.triangulated != 0, view.matches, -1).astype(np.int32)


@dataclass(frozen=True)
class ThirdView:
    """A view beside a candidate's.

    Attributes
    ----------
    view
        The view.
    partners
        Per keypoint of the candidate's view its keypoint, -1 for none.
    """

    view: View
    partners: Indices


@dataclass(frozen=True)
class ThirdViews:
    """Views that say something of a candidate's motions.

    Attributes
    ----------
    views
        The views.
    fewest_common
        So many of the candidate's points one of them must see.
    """

    views: tuple[ThirdView, ...]
    fewest_common: int

    @staticmethod
    def of(candidate: Candidate, kept: InitialViews, limits: InitializationConfig) -> ThirdViews:
        """Those that show most of what the last frame shows; or, if none does, what is left.

        A car that has few images a second sees little of a thing in three of them: then views count
        that could not begin a map, and what was matched while one of the two was the last frame.
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
        """Whether a view sees enough of what each of the motions has placed."""
        seen = third.partners >= 0
        return all(
            np.count_nonzero(seen & (placed_matches(candidate.view, motion) >= 0))
            >= self.fewest_common
            for motion in candidate.motions
        )


def _moved(third: View, view: View, limits: InitializationConfig) -> bool:
    """Whether a view has moved enough from another and from the last frame to say something."""
    between = min(third.displacement, abs(view.displacement - third.displacement))
    return between >= limits.third_view_share * view.displacement


def _lies_between(third: ThirdView, view: View, limits: InitializationConfig) -> bool:
    """The same of what all three see: what lies far away, which is seen for long, moves less."""
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
    """The motion that most of the other views agree with, and those that fit them nearly as well.

    None of the motions is left if the other views do not agree, or cannot say. Where more than one
    is left, the best fits them, but not much better than those that lead elsewhere.
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
    """Whether two motions lead more than so many degrees apart.

    Straight on to a wall its two motions are nearly one, and noise alone tells them apart.
    """
    cosine = float(motion.T_21.translation @ other.T_21.translation)  # both of length 1
    return cosine < math.cos(math.radians(degrees))


def _verdicts(candidate: Candidate, third: ThirdView, last: core.Frame) -> FloatArray:
    """How well a third view fits to each motion, (motions, 2).

    The share of the common points that it sees where they should be, and their mean squared
    distance from there in units of its variance, at most 5.99 each.
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
    """Where a view may have been while the camera went from the first one to the last."""
    return [core.Pose.exp(share * T_21.log()) for share in (0.5, 0.0, 1.0)]


def pose_of_view(
    starts: Sequence[core.Pose],
    points: FloatArray,
    keypoints: npt.NDArray[np.floating],
    inverse_sigma2: npt.NDArray[np.floating],
    camera: core.Camera,
) -> tuple[core.Pose, FloatArray]:
    """Pose of a view that sees points, and their squared errors (n,) in units of the variance.

    Parameters
    ----------
    starts
        Where the estimate begins; what fits best is taken.
    points
        (n, 3), in the frame of the first view.
    keypoints
        Where the view sees them, (n, 2) pixels.
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
    """Squared distances (n,) of points (n, 3) from where they are seen, over the variance.

    Infinite where the camera cannot see a point.
    """
    positions = np.ascontiguousarray(T_cw @ np.ascontiguousarray(points))
    error = camera.errors(positions, np.ascontiguousarray(keypoints, np.float64))
    chi2 = np.sum(error**2, axis=1) * inverse_sigma2
    return np.where(np.isnan(chi2), np.inf, chi2)
