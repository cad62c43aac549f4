# SPDX-License-Identifier: BSD-3-Clause
"""The accelerometer beside the path of the camera: gravity, scale, and exchanged axes.

The specific force of the IMU, turned into the world, is acceleration minus gravity. Integrated
twice it is the path: ``D(t) = s p(t) + c0 + c1 t - g t^2 / 2 + B(t) b`` with the scale s of the
path (one camera: metres per unit), gravity g, the bias b of the accelerometer, and c0, c1 anew for
each part of the path. All unknowns are linear. Exchanged axes of the accelerometer only change D,
so all 48 exchanges and signs are solved together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.inertial.check.rates import signed_permutations
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import quaternions_from_rotations, rotations_from_quaternions

#: Length of the parts of the path [s]: errors of the path grow with the time.
_PART = 2.0
#: Expected bias of an accelerometer [m/s^2], and of a point of the path [m].
_BIAS, _POINT = 0.1, 0.01
#: Errors of poses are common to so many seconds. In units of their variance, the sum of squares by
#: which one sign of the readings must fit better than the other.
_COMMON, _CERTAIN = 0.5, 15.0
#: Factor on the misfit of the best axes, up to which others are as good.
_NEAR_BEST = 1.1
#: Shorter paths [s] do not separate gravity from motion.
_SHORTEST = 1.5


@dataclass(frozen=True)
class GravityFit:
    """Result of the accelerometer with the given axes, and the axes that fit best.

    Attributes
    ----------
    gravity
        In the world of the path, (3,), m/s^2: where things fall.
    bias
        Of the accelerometer (3,), m/s^2, in the frame that the rotation belongs to.
    scale, scale_deviation
        Metres per unit of the path, with the given axes.
    misfit
        Root mean square residual [m].
    best_axes, best_misfit
        The exchange of axes (3, 3) that fits best: readings in the frame of the IMU are
        ``best_axes @ reading``; and its residual [m].
    negated_misfit
        Residual with all readings negated [m].
    seconds
        Length of the path.
    up
        Force without the bias in the world, (n, 3), m/s^2, for a plot, at the times `t`.
    t
        Seconds on the clock of the IMU.
    """

    gravity: FloatArray
    bias: FloatArray
    scale: float
    scale_deviation: float
    misfit: float
    best_axes: FloatArray
    best_misfit: float
    negated_misfit: float
    seconds: float
    up: FloatArray
    t: FloatArray

    @property
    def magnitude(self) -> float:
        """Length of gravity, m/s^2."""
        return float(np.linalg.norm(self.gravity))

    @property
    def knows_sign(self) -> bool:
        """Whether the readings fit clearly better than with the opposite sign."""
        return self._is_worse(self.negated_misfit, self.misfit)

    @property
    def is_negated(self) -> bool:
        """Whether the opposite sign fits clearly better, and no other axes fit better still."""
        is_best = self.negated_misfit < _NEAR_BEST * self.best_misfit
        return is_best and self._is_worse(self.misfit, self.negated_misfit)

    def _is_worse(self, misfit: float, other: float) -> bool:
        n = 3 * self.seconds / _COMMON
        return (misfit / max(other, 1e-9)) ** 2 - 1 > _CERTAIN / n


def fit_gravity(
    t: FloatArray, accel: FloatArray, path: Trajectory, T_ci: FloatArray, offset: float
) -> GravityFit | None:
    """Compare the accelerometer with a path.

    Parameters
    ----------
    t, accel
        Samples: seconds (n,), and readings in m/s^2 (n, 3).
    path
        Poses of the camera, all in one world and without gaps.
    T_ci
        From the IMU to the camera, (4, 4).
    offset
        Seconds to add to the clock of the path for that of the IMU.

    Returns
    -------
    GravityFit or None
        None if path and samples have too little time in common.
    """
    at = path.timestamps + offset
    inside = (at >= t[0]) & (at <= t[-1])
    if inside.sum() < 10 or np.ptp(at[inside]) < _SHORTEST:
        return None
    at, T_wc = at[inside], path.T_wc[inside]
    # With a sample beyond each end: things fall far in a part of a step.
    first = max(0, int(np.searchsorted(t, at[0], side="right")) - 1)
    last = int(np.searchsorted(t, at[-1], side="left")) + 1
    t, accel = t[first:last], accel[first:last]
    R_wb = _rotations_at(at, T_wc[:, :3, :3], t) @ T_ci[:3, :3]
    arm = T_wc[:, :3, :3] @ T_ci[:3, 3]  # from the camera to the IMU, metres
    # Twice integrated: each axis of the IMU by each reading, and each axis alone for the bias.
    forces = np.einsum("nki,nj->nkij", R_wb, accel).reshape(len(t), -1)
    paths = _at_poses(t, np.hstack([forces, R_wb.reshape(len(t), 9)]), at)
    forced = paths[:, :27].reshape(-1, 3, 3, 3)
    A, rows = _design(at, T_wc[:, :3, 3], paths[:, 27:].reshape(-1, 3, 3))
    all_axes = signed_permutations()
    D = np.stack([np.einsum("nkij,ij->nk", forced, P) - arm for P in all_axes], axis=-1)
    y = np.vstack([D.reshape(rows, -1) / _POINT, np.zeros((3, len(all_axes)))])
    with_path, left = _solve(A, y)
    _, left_without = _solve(np.delete(A, 6, axis=1), y)
    # The path of a camera is not turned round: with a negative scale the path explains nothing.
    misfit = _POINT * np.sqrt(np.where(with_path[6] > 0, left, left_without) / rows)
    best = int(misfit.argmin())
    if misfit[0] <= 1.02 * misfit[best]:
        best = 0
    x = with_path[:, 0]
    spread = np.sqrt(np.linalg.pinv(A.T @ A)[6, 6] * left[0] / rows)
    return GravityFit(
        gravity=x[:3],
        bias=x[3:6],
        scale=float(x[6]),
        scale_deviation=float(spread),
        misfit=float(misfit[0]),
        best_axes=all_axes[best],
        best_misfit=float(misfit[best]),
        negated_misfit=float(misfit[_negated(all_axes)]),
        seconds=float(np.ptp(at)),
        up=np.einsum("nki,ni->nk", R_wb, accel - x[3:6]),
        t=t,
    )


def _negated(all_axes: list[FloatArray]) -> int:
    return next(k for k, P in enumerate(all_axes) if np.array_equal(P, -np.eye(3)))


def _design(at: FloatArray, p: FloatArray, biased: FloatArray) -> tuple[FloatArray, int]:
    """Columns: gravity (3), bias (3), scale, and six of each part of the path."""
    seconds = at - at[0]
    parts = np.minimum((seconds / _PART).astype(int), max(0, int(seconds[-1] / _PART) - 1))
    n_parts = int(parts.max()) + 1
    A = np.zeros((len(at), 3, 7 + 6 * n_parts))
    for k in range(3):
        A[:, k, k] = -0.5 * seconds**2
        A[:, k, 6] = p[:, k]
        A[np.arange(len(at)), k, 7 + 6 * parts + k] = 1.0
        A[np.arange(len(at)), k, 10 + 6 * parts + k] = seconds
    A[:, :, 3:6] = biased
    rows = 3 * len(at)
    prior = np.zeros((3, A.shape[2]))
    prior[range(3), range(3, 6)] = 1.0 / _BIAS
    return np.vstack([A.reshape(rows, -1) / _POINT, prior]), rows


def _solve(A: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solutions, one a column, and the sum of squares that each leaves."""
    Q, R = np.linalg.qr(A)  # reduces the later problem
    x = np.asarray(np.linalg.lstsq(R, Q.T @ y, rcond=None)[0], np.float64)
    return x, np.asarray(((A @ x - y) ** 2).sum(axis=0))


def _at_poses(t: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Integrate values (n, m) twice, and give them at the times of the poses."""
    for _ in range(2):
        steps = 0.5 * np.diff(t)[:, None] * (values[1:] + values[:-1])
        values = np.vstack([np.zeros(values.shape[1]), np.cumsum(steps, axis=0)])
    return np.column_stack([np.interp(at, t, one) for one in values.T])


def _rotations_at(at: FloatArray, R: FloatArray, t: FloatArray) -> FloatArray:
    """Rotations between poses: the quaternions are interpolated and normalised."""
    q = quaternions_from_rotations(R)
    flips = np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    q[1:] *= np.cumprod(flips)[:, None]
    return rotations_from_quaternions(np.column_stack([np.interp(t, at, one) for one in q.T]))
