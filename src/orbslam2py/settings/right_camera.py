# SPDX-License-Identifier: BSD-3-Clause
"""The right camera of a fisheye pair, and all groups of one settings file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._arrays import EqualByValue, FloatArray, MadeAgainByCopies
from orbslam2py.errors import SettingsError
from orbslam2py.settings.extrinsics import checked_extrinsics, inverse_of
from orbslam2py.settings.groups import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    StereoRectification,
    ViewerSettings,
)
from orbslam2py.settings.rig import RigCamera


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
    rig: tuple[RigCamera, ...] | None
