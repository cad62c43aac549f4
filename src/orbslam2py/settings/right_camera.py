# SPDX-License-Identifier: BSD-3-Clause
"""The right camera of a fisheye pair, and all groups of one settings file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._arrays import EqualByValue, FloatArray, MadeAgainByCopies
from orbslam2py.errors import SettingsError
from orbslam2py.settings.groups import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    StereoRectification,
    ViewerSettings,
)

#: Largest error of the rotation of an extrinsic matrix; printed ones have some six digits.
_ROTATION_TOLERANCE = 1e-3


def checked_extrinsics(T: object, name: str) -> FloatArray:
    """Take a rigid transform between two cameras.

    Parameters
    ----------
    T
        4 x 4 numbers: a rotation and a translation [m].
    name
        What it is called, for messages.

    Returns
    -------
    FloatArray
        float64 (4, 4), read-only.

    Raises
    ------
    SettingsError
        If it is no rigid transform, or both cameras stand in one place.
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
    if not pose[:3, 3].any():
        raise SettingsError(
            "the two cameras of the pair stand in one place, so they see no depth; look at where "
            "their calibration puts them, or use one of them (--sensor mono)"
        )
    pose.setflags(write=False)
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


@dataclass(frozen=True, eq=False)
class RightCamera(EqualByValue, MadeAgainByCopies):
    """The right camera of a pair that is matched without rectification: a fisheye pair.

    Attributes
    ----------
    camera
        Its lens and intrinsics; images must have the size of the left ones.
    T_left_right
        From right to left camera coordinates, (4, 4), metres: its translation is where the right
        camera stands. Kalibr and others give the inverse, `T_right_left`.

    Raises
    ------
    SettingsError
        If the transform is not rigid, or moves nothing.
    """

    camera: CameraSettings
    T_left_right: FloatArray

    def __post_init__(self) -> None:
        if not isinstance(self.camera, CameraSettings):
            raise SettingsError(f"the right camera is {shown(self.camera)}; give CameraSettings")
        pose = checked_extrinsics(self.T_left_right, "T_left_right")
        object.__setattr__(self, "T_left_right", pose)

    @property
    def T_right_left(self) -> FloatArray:
        """From left to right camera coordinates, (4, 4), metres."""
        return inverse_of(self.T_left_right)

    @property
    def centre(self) -> FloatArray:
        """Where the right camera stands, in left camera coordinates, (3,), metres."""
        return self.T_left_right[:3, 3]

    @property
    def baseline(self) -> float:
        """Distance of the two cameras, metres."""
        return float(np.linalg.norm(self.centre))


class SettingsGroups(TypedDict):
    """All groups of one settings file, by the names of the fields of `Settings`.

    The reader gives them and the writer takes them, so that neither needs to know `Settings`.
    """

    camera: CameraSettings
    orb: OrbSettings
    depth: DepthSettings | None
    rectification: StereoRectification | None
    viewer: ViewerSettings
    right: RightCamera | None
