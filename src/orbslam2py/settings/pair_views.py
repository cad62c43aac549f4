# SPDX-License-Identifier: BSD-3-Clause
"""Relative view of the two raw cameras of a stereo pair."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings.groups import StereoRectification

#: Part of the left view below which a pair hardly looks the same way.
LEAST_OVERLAP = 0.6
_COLUMNS, _ROWS = 41, 31
#: Baselines of pairs, also of those that a depth camera counts as, beyond which one is doubted [m].
_LEAST_BASELINE, MOST_BASELINE = 1e-4, 10.0

_View = tuple[FloatArray, tuple[int, int]]


@dataclass(frozen=True)
class PairViews:
    """Relative view of the two raw cameras of a pair.

    Attributes
    ----------
    turned
        Angle of the rotation from one to the other, degrees.
    overlap
        Share of one camera's view of distant points that the other one sees, 0 to 1: the larger of
        both.
    """

    turned: float
    overlap: float

    def __str__(self) -> str:
        return (
            f"the two cameras are turned by {self.turned:.1f} degrees against each other, and "
            f"{self.overlap:.0%} of their views overlap"
        )


def is_likely_baseline(baseline: float) -> bool:
    """Return whether this baseline [m] is plausible: most others are in another unit."""
    return _LEAST_BASELINE <= baseline <= MOST_BASELINE


def views_of_pair(pair: StereoRectification) -> PairViews:
    """Compare the views of both raw cameras of a pair."""
    return compare_views(
        (pair.left.K, (pair.left.width, pair.left.height)),
        (pair.right.K, (pair.right.width, pair.right.height)),
        pair.right.R.T @ pair.left.R,
    )


def compare_views(left: _View, right: _View, R_right_left: FloatArray) -> PairViews:
    """Compare the views of two cameras, without distortion.

    Parameters
    ----------
    left, right
        Camera matrix (3, 3) and image size, pixels.
    R_right_left
        Rotation (3, 3) from left to right camera coordinates.
    """
    overlap = max(_seen_part(left, right, R_right_left), _seen_part(right, left, R_right_left.T))
    return PairViews(_angle(R_right_left), overlap)


def _seen_part(one: _View, other: _View, R_other_one: FloatArray) -> float:
    """Return the share of the view of one camera that the other one sees."""
    (K, (width, height)), (K_other, size) = one, other
    u, v = np.meshgrid(np.linspace(0, width - 1, _COLUMNS), np.linspace(0, height - 1, _ROWS))
    pixels = np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
    seen = K_other @ R_other_one @ np.linalg.solve(K, pixels)
    before = seen[2] > 1e-9
    x, y = seen[:2] / np.where(before, seen[2], 1.0)
    inside = (x >= -0.5) & (x < size[0] - 0.5) & (y >= -0.5) & (y < size[1] - 0.5)
    return float(np.mean(before & inside))


def _angle(R: FloatArray) -> float:
    return math.degrees(math.acos(max(-1.0, min(1.0, (float(np.trace(R)) - 1) / 2))))
