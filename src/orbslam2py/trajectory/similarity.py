# SPDX-License-Identifier: BSD-3-Clause
"""Transforms between worlds of different units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray


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
