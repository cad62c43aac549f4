# SPDX-License-Identifier: BSD-3-Clause
"""Rigid transforms between cameras."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError

#: Largest error of the rotation of an extrinsic matrix; printed ones have some six digits.
_ROTATION_TOLERANCE = 1e-3


def rigid_transform(T: object, name: str) -> FloatArray:
    """Take a rigid transform: float64 (4, 4), read-only.

    Parameters
    ----------
    T
        4 x 4 numbers: a rotation and a translation [m].
    name
        Its name in messages.

    Raises
    ------
    SettingsError
        If it is none.
    """
    try:
        pose = np.array(T, dtype=np.float64)
    except (TypeError, ValueError):
        pose = np.zeros(0)
    if not _is_rigid(pose):
        raise SettingsError(
            f"{name} is no rigid transform; give 4 x 4 numbers: a rotation and a translation in "
            "metres, with the last row 0, 0, 0, 1"
        )
    pose.setflags(write=False)
    return pose


def checked_extrinsics(T: object, name: str) -> FloatArray:
    """Take a rigid transform between two cameras.

    Parameters
    ----------
    T
        4 x 4 numbers: a rotation and a translation [m].
    name
        Its name in messages.

    Returns
    -------
    FloatArray
        float64 (4, 4), read-only.

    Raises
    ------
    SettingsError
        If it is no rigid transform, or both cameras have the same position.
    """
    pose = rigid_transform(T, name)
    if not pose[:3, 3].any():
        raise SettingsError(
            "the two cameras of the pair have the same position, so they measure no depth; "
            "check where their calibration puts them, or use one of them (--sensor mono)"
        )
    return pose


def inverse_of(T: FloatArray) -> FloatArray:
    """Return the inverse of a rigid transform (4, 4)."""
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = T[:3, :3].T, -T[:3, :3].T @ T[:3, 3]
    return inverse


def _is_rigid(T: FloatArray) -> bool:
    if T.shape != (4, 4) or not np.isfinite(T).all():
        return False
    R = T[:3, :3]
    off = float(np.abs(R @ R.T - np.eye(3)).max()), float(np.abs(T[3] - (0, 0, 0, 1)).max())
    return off[0] < _ROTATION_TOLERANCE and off[1] < 1e-6 and float(np.linalg.det(R)) > 0
