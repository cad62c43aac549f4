# SPDX-License-Identifier: BSD-3-Clause
"""What other views say of a motion that was found between two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.initialization.kept_views import Indices, View
from orbslam2py.slam.thresholds import InitializationThresholds

Motion: TypeAlias = core.TwoViewResult | core.TwoViewMotion

_FEWEST_COMMON = 30  # points that a third view must see to be asked
_INLIER_CHI2 = 5.991  # 95 %, two degrees of freedom
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


def placed_matches(view: View, motion: Motion) -> Indices:
    """Per keypoint of a view the index in the last frame, -1 where no point was placed."""
    return np.where(motion.triangulated != 0, view.matches, -1).astype(np.int32)


def confirmed_motion(
    candidate: Candidate, views: Sequence[View], last: core.Frame, limits: InitializationThresholds
) -> Motion | None:
    """The motion that most of the other views agree with; None if they do not, or cannot say.

    A view that lies so near to one of the two that any motion would suit it is not asked. Where
    two motions are left, the right one must fit much better than the next best.
    """
    thirds = [third for third in views if _says_something(candidate.view, third, limits)]
    verdicts = [_verdicts(candidate, third, last) for third in thirds]
    asked = np.array([verdict for verdict in verdicts if verdict is not None])
    if not len(asked):
        return None
    shares, costs = np.moveaxis(asked, -1, 0)  # (views, motions)
    mean_costs = costs.mean(axis=0)
    best = int(np.argmin(mean_costs))
    if 2 * np.count_nonzero(shares[:, best] >= limits.third_view_fits) <= len(asked):
        return None
    if candidate.motions[best].parallax < limits.parallax:
        return None
    others = np.delete(mean_costs, best)
    if len(others) and others.min() < limits.clearly_worse * mean_costs[best]:
        return None
    return candidate.motions[best]


def _says_something(view: View, third: View, limits: InitializationThresholds) -> bool:
    between = min(third.displacement, abs(view.displacement - third.displacement))
    return third is not view and between >= limits.third_view_share * view.displacement


def _verdicts(candidate: Candidate, third: View, last: core.Frame) -> FloatArray | None:
    """How well a third view fits to each motion, (motions, 2), None if it sees too few points.

    The share of the common points that it sees where they should be, and their mean squared
    distance from there in units of its variance, at most 5.99 each.
    """
    partners = candidate.view.partners(third)
    verdicts = []
    for motion in candidate.motions:
        placed = placed_matches(candidate.view, motion) >= 0
        common = np.flatnonzero(placed & (partners >= 0))
        if len(common) < _FEWEST_COMMON:
            return None
        seen = partners[common]
        chi2 = _squared_errors(
            motion, motion.points[common], third.keypoints[seen], 1 / third.frame.sigma2[seen], last
        )
        verdicts.append([np.mean(chi2 < _INLIER_CHI2), np.mean(np.minimum(chi2, _INLIER_CHI2))])
    return np.array(verdicts)


def _squared_errors(
    motion: Motion,
    points: FloatArray,
    keypoints: np.ndarray,
    inverse_sigma2: np.ndarray,
    last: core.Frame,
) -> FloatArray:
    """Squared distances (n,) of points from where a view sees them, in units of the variance.

    The view's pose is estimated from them, beginning on the way from the first view to the last.
    """
    fx, fy, cx, cy = intrinsics(last.camera)
    pixels = np.full((len(points), 3), np.nan)
    pixels[:, :2] = keypoints
    best = np.full(len(points), np.inf)
    for share in (0.5, 0.0, 1.0):
        start = core.Pose.exp(share * motion.T_21.log())
        found = core.optimize_pose(
            start, intrinsics(last.camera), 0.0, points, pixels, inverse_sigma2
        )
        x, y, z = (found.T_cw @ np.ascontiguousarray(points)).T
        ahead = z > 0
        z = np.where(ahead, z, 1.0)
        error = np.stack([fx * x / z + cx, fy * y / z + cy], axis=1) - keypoints
        chi2 = np.where(ahead, np.sum(error**2, axis=1) * inverse_sigma2, np.inf)
        if np.minimum(chi2, _INLIER_CHI2).sum() < np.minimum(best, _INLIER_CHI2).sum():
            best = chi2
    return best
