# SPDX-License-Identifier: BSD-3-Clause
"""Transforms between worlds of different units, and their estimation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arguments import array_of, finite_number
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import nearest_rotations

#: Products of a rotation's rows may be off by so much: a few digits, as people copy them ...
_COPIED = 1e-3
#: ... and by so much when they were computed.
_COMPUTED = 1e-12
#: Points lie on a line, but for rounding, if they covary so much less across it with their targets.
_ROUNDED = 1e-10


@dataclass(frozen=True, eq=False)
class Similarity:
    """A similarity transform ``y = scale * R @ x + t``.

    Attributes
    ----------
    scale
        Ratio of lengths, above 0.
    R
        Rotation, float64 (3, 3); made orthonormal if it was rounded.
    t
        Translation, float64 (3,).

    Raises
    ------
    DatasetError
        If the scale is not above 0, `R` is no rotation, or a number is not finite.
    """

    scale: float
    R: FloatArray
    t: FloatArray

    def __post_init__(self) -> None:
        wanted = "a number above 0"
        scale = finite_number(self.scale, "the scale of the similarity", wanted, DatasetError)
        if scale <= 0:
            raise DatasetError(f"the scale of the similarity is {scale:g}; give {wanted}")
        R = array_of(self.R, "the rotation R of the similarity", (3, 3), finite=False)
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is no rotation
            off = float(np.abs(R @ R.T - np.eye(3)).max())
        if not off <= _COPIED or np.linalg.det(R) < 0:
            raise DatasetError(
                "R of the similarity is no rotation; give a matrix with orthonormal rows and "
                "determinant +1, the scale apart from it"
            )
        if off > _COMPUTED:
            R = nearest_rotations(R)
        t = array_of(self.t, "the translation t of the similarity", (3,), finite=False)
        if not np.isfinite(t).all():
            raise DatasetError("the translation t of the similarity is not finite; give 3 numbers")
        for name, value in (("scale", scale), ("R", R), ("t", t)):
            object.__setattr__(self, name, value)

    @classmethod
    def identity(cls) -> Similarity:
        """Return the identity."""
        return cls(1.0, np.eye(3), np.zeros(3))

    def inverse(self) -> Similarity:
        """Return the inverse transform."""
        return Similarity(1 / self.scale, self.R.T, -(self.R.T @ self.t) / self.scale)

    def apply(self, points: FloatArray) -> FloatArray:
        """Transform points (n, 3); returns float64 (n, 3)."""
        moved: FloatArray = self.scale * points @ self.R.T + self.t
        return moved

    def apply_to_poses(self, T_wc: FloatArray) -> FloatArray:
        """Transform poses (n, 4, 4), camera to world: positions as points, and orientations."""
        moved: FloatArray = T_wc.copy()
        moved[:, :3, :3] = self.R @ T_wc[:, :3, :3]
        moved[:, :3, 3] = self.apply(T_wc[:, :3, 3])
        return moved


def align(
    points: FloatArray,
    targets: FloatArray,
    *,
    with_scale: bool = False,
    on_a_line: bool | None = None,
) -> Similarity:
    """Estimate the transform from points to their targets by least squares (Umeyama, PAMI 1991).

    Parameters
    ----------
    points, targets
        float64 (n, 3), at least one.
    with_scale
        Whether lengths may change. They do not if all points of a set are at one position, because
        the scale is unknown then.
    on_a_line
        Whether one of the sets counts as a straight line, about which the rotation is unknown; by
        default if it is one up to rounding. Then the smallest rotation of the line is used; for a
        single position there is no rotation.

    Returns
    -------
    Similarity
        Always finite.

    Raises
    ------
    DatasetError
        If they are no such arrays.
    """
    points = array_of(points, "points", (-1, 3))
    targets = array_of(targets, "targets", (-1, 3))
    if len(points) != len(targets) or not len(points):
        raise DatasetError(
            f"{len(points)} points cannot be aligned to {len(targets)} targets; give one target "
            "per point, at least one"
        )
    centre, target_centre = points.mean(axis=0), targets.mean(axis=0)
    x, y = points - centre, targets - target_centre
    U, stretch, Vt = np.linalg.svd(y.T @ x / len(x))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    if on_a_line is None:
        on_a_line = bool(stretch[1] <= _ROUNDED * stretch[0])
    if stretch[0] <= 0:
        R = np.eye(3)
    elif on_a_line:
        R = _least_rotation(Vt[0], U[:, 0])
    else:
        R = U @ (signs[:, None] * Vt)
    scale = 1.0
    spread, target_spread = np.mean(np.sum(x**2, axis=1)), np.mean(np.sum(y**2, axis=1))
    if with_scale and spread > 1e-18 and target_spread > 1e-18:
        fitted = float(np.sum(stretch * signs) / spread)
        scale = fitted if fitted > 1e-12 else 1.0
    return Similarity(scale, R, target_centre - scale * R @ centre)


def align_yaw(points: FloatArray, targets: FloatArray) -> Similarity:
    """Estimate yaw and translation from points to their targets by least squares.

    Parameters
    ----------
    points, targets
        float64 (n, 3), at least one, in worlds whose third axis is up.

    Returns
    -------
    Similarity
        Of scale 1; its rotation is one about the third axis.

    Raises
    ------
    DatasetError
        If they are no such arrays.
    """
    points = array_of(points, "points", (-1, 3))
    targets = array_of(targets, "targets", (-1, 3))
    if len(points) != len(targets) or not len(points):
        raise DatasetError(
            f"{len(points)} points cannot be aligned to {len(targets)} targets; give one target "
            "per point, at least one"
        )
    centre, target_centre = points.mean(axis=0), targets.mean(axis=0)
    (x, y), (u, v) = (points - centre).T[:2], (targets - target_centre).T[:2]
    yaw = np.arctan2(np.sum(x * v - y * u), np.sum(x * u + y * v))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    R = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return Similarity(1.0, R, target_centre - R @ centre)


def _least_rotation(direction: FloatArray, target: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) from one unit vector to another."""
    cosine = float(direction @ target)
    if cosine < -1 + 1e-9:
        # Half a turn, around any axis across: the one nearest to an axis of the world.
        across = np.eye(3)[np.argmin(np.abs(direction))]
        axis = across - (across @ direction) * direction
        half_turn: FloatArray = 2 * np.outer(axis, axis) / (axis @ axis) - np.eye(3)
        return half_turn
    x, y, z = np.cross(direction, target)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    R: FloatArray = np.eye(3) + cross + cross @ cross / (1 + cosine)
    return R
