# SPDX-License-Identifier: BSD-3-Clause
"""An estimate brought onto the truth: poses matched by time, and the transform between worlds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, associate


class Alignment(str, Enum):
    """How the estimate is moved onto the truth before the absolute error is taken."""

    SE3 = "se3"
    """Turned and shifted."""
    SIM3 = "sim3"
    """Turned, shifted and scaled: for one camera, which cannot see metres."""
    NONE = "none"
    """Left as it is: both are in one world."""

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, eq=False)
class Similarity:
    """A similarity transform ``y = scale * R @ x + t``.

    Attributes
    ----------
    scale
        Ratio of lengths, above 0.
    R
        Rotation, float64 (3, 3).
    t
        Translation, float64 (3,).
    """

    scale: float
    R: FloatArray
    t: FloatArray

    @classmethod
    def identity(cls) -> Similarity:
        """Make the transform that changes nothing."""
        return cls(1.0, np.eye(3), np.zeros(3))

    def inverse(self) -> Similarity:
        """Make the transform that undoes this one."""
        return Similarity(1 / self.scale, self.R.T, -(self.R.T @ self.t) / self.scale)

    def apply(self, points: FloatArray) -> FloatArray:
        """Transform points (n, 3); returns float64 (n, 3)."""
        moved: FloatArray = self.scale * points @ self.R.T + self.t
        return moved

    def apply_to_poses(self, T_wc: FloatArray) -> FloatArray:
        """Transform poses (n, 4, 4), camera to world: positions as points, orientations turned."""
        moved: FloatArray = T_wc.copy()
        moved[:, :3, :3] = self.R @ T_wc[:, :3, :3]
        moved[:, :3, 3] = self.apply(T_wc[:, :3, 3])
        return moved


def align(points: FloatArray, targets: FloatArray, *, with_scale: bool = False) -> Similarity:
    """Find the transform that moves points nearest to their targets (Umeyama, PAMI 1991).

    Parameters
    ----------
    points, targets
        float64 (n, 3), at least one.
    with_scale
        Whether lengths may change. They do not if one of the sets is a single place, where no
        scale can be seen; a rotation that cannot be seen is chosen so that nothing is turned.

    Returns
    -------
    Similarity
        Always finite.
    """
    centre, target_centre = points.mean(axis=0), targets.mean(axis=0)
    x, y = points - centre, targets - target_centre
    U, stretch, Vt = np.linalg.svd(y.T @ x / len(x))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = U @ (signs[:, None] * Vt) if stretch[0] > 0 else np.eye(3)
    scale = 1.0
    spread, target_spread = np.mean(np.sum(x**2, axis=1)), np.mean(np.sum(y**2, axis=1))
    if with_scale and spread > 1e-18 and target_spread > 1e-18:
        fitted = float(np.sum(stretch * signs) / spread)
        scale = fitted if fitted > 1e-12 else 1.0
    return Similarity(scale, R, target_centre - scale * R @ centre)


def match_poses(
    estimate: Trajectory, truth: Trajectory, max_difference: float = MAX_DIFFERENCE
) -> tuple[IntArray, IntArray]:
    """Find which poses belong together by their time stamps.

    Parameters
    ----------
    estimate, truth
        Both on one clock.
    max_difference
        Poses belong together if their time stamps differ by less [s].

    Returns
    -------
    i, j
        Indices into the estimate and into the truth, (k,) each, k > 0.

    Raises
    ------
    DatasetError
        If no time stamps match.
    """
    i, j = associate(estimate.timestamps, truth.timestamps, max_difference)
    if not len(i):
        raise DatasetError(
            f"no poses to compare: no time stamps of estimate ({_span(estimate)}) and ground truth "
            f"({_span(truth)}) differ by less than {max_difference} s"
        )
    return i, j


def _span(trajectory: Trajectory) -> str:
    if not len(trajectory):
        return "no poses"
    times = trajectory.timestamps
    return f"{len(times)} poses from {times.min():.3f} to {times.max():.3f} s"
