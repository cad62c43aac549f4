# SPDX-License-Identifier: BSD-3-Clause
"""A smooth path through poses: angular rates and accelerations are continuous."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.trajectory.rotations import (
    poses_from,
    quaternions_from_rotations,
    rotations_from_quaternions,
)


class PoseSpline:
    """Natural cubic splines through positions and quaternions; the latter are normalised.

    It goes through all poses, and its second derivatives are continuous.

    Parameters
    ----------
    t
        Seconds, increasing, (n,), n >= 2.
    T_wb
        Poses of the body in the world, (n, 4, 4).
    """

    def __init__(self, t: FloatArray, T_wb: FloatArray) -> None:
        self._t = t
        q = quaternions_from_rotations(T_wb[:, :3, :3])
        flips = np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)
        q[1:] *= np.cumprod(flips)[:, None]
        self._values = np.hstack([T_wb[:, :3, 3], q])
        self._bends = _second_derivatives(t, self._values)

    def poses(self, t: FloatArray) -> FloatArray:
        """Poses at times inside the path, (m, 4, 4)."""
        values = self._at(t)[0]
        return poses_from(rotations_from_quaternions(values[:, 3:]), values[:, :3])

    def rates(self, t: FloatArray) -> FloatArray:
        """Angular rate in the frame of the body [rad/s], (m, 3)."""
        values, slopes, _ = self._at(t)
        q, dq = values[:, 3:], slopes[:, 3:]
        norm = (q * q).sum(axis=1, keepdims=True)
        # 2 q^-1 dq, of which the normalisation only changes the real part.
        v, w, dv, dw = q[:, :3], q[:, 3:], dq[:, :3], dq[:, 3:]
        return np.asarray(2 * (w * dv - dw * v - np.cross(v, dv)) / norm)

    def accelerations(self, t: FloatArray) -> FloatArray:
        """Acceleration in the world [m/s^2], (m, 3)."""
        return self._at(t)[2][:, :3]

    def _at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Values, first and second derivatives, each (m, 7)."""
        k = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._t) - 2)
        h = (self._t[k + 1] - self._t[k])[:, None]
        b = (t[:, None] - self._t[k][:, None]) / h
        a = 1.0 - b
        y0, y1, m0, m1 = self._values[k], self._values[k + 1], self._bends[k], self._bends[k + 1]
        values = a * y0 + b * y1 + ((a**3 - a) * m0 + (b**3 - b) * m1) * h**2 / 6
        slopes = (y1 - y0) / h + ((3 * b**2 - 1) * m1 - (3 * a**2 - 1) * m0) * h / 6
        return values, slopes, a * m0 + b * m1


def _second_derivatives(t: FloatArray, y: FloatArray) -> FloatArray:
    """Second derivatives (n, m) at the knots, 0 at both ends: Thomas' algorithm."""
    n = len(t)
    m = np.zeros_like(y)
    if n < 3:
        return m
    h = np.diff(t)
    right = 6 * np.diff(np.diff(y, axis=0) / h[:, None], axis=0)
    diagonal = 2 * (h[:-1] + h[1:])
    for i in range(1, n - 2):
        factor = h[i] / diagonal[i - 1]
        diagonal[i] -= factor * h[i]
        right[i] -= factor * right[i - 1]
    for i in range(n - 3, -1, -1):
        m[i + 1] = (right[i] - h[i + 1] * m[i + 2]) / diagonal[i]
    return m
