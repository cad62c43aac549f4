# SPDX-License-Identifier: BSD-3-Clause
"""Rotations and rigid transforms as arrays, many at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import are_poses
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError


def quaternions_from_rotations(R: FloatArray) -> FloatArray:
    """Convert rotation matrices to unit quaternions.

    Parameters
    ----------
    R
        Rotations (n, 3, 3).

    Returns
    -------
    FloatArray
        Quaternions x, y, z, w, float64 (n, 4). If the trace is positive w is positive, otherwise
        the component that belongs to the largest diagonal element (Shepperd 1978).
    """
    R = np.asarray(R, dtype=np.float64).reshape(-1, 3, 3)
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    # Four times the products of the components; each column is the quaternion times one of them.
    products = np.empty((len(R), 4, 4))
    products[:, 0, 0] = 1 + xx - yy - zz
    products[:, 1, 1] = 1 - xx + yy - zz
    products[:, 2, 2] = 1 - xx - yy + zz
    products[:, 3, 3] = 1 + xx + yy + zz
    for a, b, c in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
        products[:, a, b] = products[:, b, a] = R[:, b, a] + R[:, a, b]
        difference = (R[:, b, a] - R[:, a, b]) * (1 if (a, b) != (0, 2) else -1)
        products[:, c, 3] = products[:, 3, c] = difference
    diagonal = np.stack([xx, yy, zz], axis=1)
    largest = np.where(diagonal.sum(axis=1) > 0, 3, diagonal.argmax(axis=1))
    chosen = products[np.arange(len(R)), largest]
    return np.asarray(chosen / np.linalg.norm(chosen, axis=1, keepdims=True))


def rotations_from_quaternions(q: FloatArray) -> FloatArray:
    """Convert quaternions x, y, z, w (n, 4), not zero, to rotation matrices (n, 3, 3)."""
    q = np.asarray(q, dtype=np.float64).reshape(-1, 4)
    x, y, z, w = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    R = np.empty((len(q), 3, 3))
    R[:, 0] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    R[:, 1] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    R[:, 2] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    return R


def nearest_rotations(M: FloatArray) -> FloatArray:
    """Find the rotations nearest to matrices (..., 3, 3), such as those read from rounded text.

    Nearest in the Frobenius norm, by the singular value decomposition.
    """
    U, _, Vt = np.linalg.svd(M)
    U[..., :, 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    return np.asarray(U @ Vt)


def rotation_angles(R: FloatArray) -> FloatArray:
    """Angles [rad], 0 to pi, of rotations (n, 3, 3); exact also for tiny ones."""
    axis = np.stack(
        [
            R[:, 2, 1] - R[:, 1, 2],
            R[:, 0, 2] - R[:, 2, 0],
            R[:, 1, 0] - R[:, 0, 1],
        ],
        axis=1,
    )
    trace = np.trace(R, axis1=1, axis2=2)
    return np.asarray(np.arctan2(np.linalg.norm(axis, axis=1), trace - 1.0))


def poses_from(R: FloatArray, t: FloatArray) -> FloatArray:
    """Combine rotations (n, 3, 3) and translations (n, 3) to transforms (n, 4, 4)."""
    T = np.zeros((len(R), 4, 4))
    T[:, :3, :3] = R
    T[:, :3, 3] = t
    T[:, 3, 3] = 1.0
    return T


def require_poses(T_wc: FloatArray, which: NDArray[np.bool_], what: str) -> None:
    """Check that transforms are poses, for a file or a comparison.

    Parameters
    ----------
    T_wc
        Transforms (n, 4, 4).
    which
        Mask of the checked ones, bool (n,).
    what
        Their owner, for the message.

    Raises
    ------
    DatasetError
        With the number of the first invalid one: not finite, or without a rotation.
    """
    bad = np.flatnonzero(which & ~are_poses(T_wc))
    if not len(bad):
        return
    number = int(bad[0])
    reason = (
        "is no pose: it must be a rotation and a translation above the row 0 0 0 1"
        if np.isfinite(T_wc[number]).all()
        else "holds a number that is not finite"
    )
    raise DatasetError(
        f"pose {number} of {what} {reason}; correct it, or leave it out with Trajectory.select"
    )


def inverse_poses(T: FloatArray) -> FloatArray:
    """Invert rigid transforms (..., 4, 4); exact for the rotation, which is transposed."""
    inverse = np.zeros_like(T)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    inverse[..., :3, :3] = Rt
    inverse[..., :3, 3] = -(Rt @ T[..., :3, 3:])[..., 0]
    inverse[..., 3, 3] = 1.0
    return inverse
