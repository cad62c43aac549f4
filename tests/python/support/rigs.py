# SPDX-License-Identifier: BSD-3-Clause
"""Small rigs of cameras for tests."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings import CameraSettings, DepthSettings, OrbSettings, RigCamera, Settings


def mounted(yaw: float, place: Sequence[float]) -> FloatArray:
    """``T_body_camera`` of a camera that is turned about the vertical [degrees, m]."""
    a = math.radians(yaw)
    T = np.eye(4)
    c, s = math.cos(a), math.sin(a)
    T[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    T[:3, 3] = place
    return T


PINHOLE = CameraSettings(200, 200, 159.5, 119.5, width=320, height=240)
WIDE = CameraSettings(
    75, 75, 127.5, 127.5, width=256, height=256, model="kannala_brandt", lens=(-0.01, 0.002, 0, 0)
)


def rig_settings(cameras: Sequence[RigCamera], n_features: int = 500) -> Settings:
    """Settings of a rig; depth images are in 1/5000 m."""
    return Settings(
        sensor="rig",
        camera=cameras[0].camera,
        orb=OrbSettings(n_features=n_features),
        depth=DepthSettings(40.0, 5000.0),
        rig=cameras,
    )


def back_to_back() -> Settings:
    """Two depth cameras that look in opposite directions."""
    return rig_settings(
        [
            RigCamera(PINHOLE, depth=True),
            RigCamera(PINHOLE, mounted(180, (0, 0, -0.2)), depth=True),
        ]
    )


def two_wide_pairs() -> Settings:
    """A fisheye pair to the front and one to the rear."""
    return rig_settings(
        [
            RigCamera(WIDE),
            RigCamera(WIDE, mounted(0, (0.12, 0, 0))),
            RigCamera(WIDE, mounted(180, (0.12, 0, -0.2))),
            RigCamera(WIDE, mounted(180, (0, 0, -0.2))),
        ]
    )


def four_around() -> Settings:
    """Four fisheye cameras around a body."""
    return rig_settings(
        [
            RigCamera(WIDE),
            RigCamera(WIDE, mounted(90, (0.12, 0, -0.12))),
            RigCamera(WIDE, mounted(180, (0, 0, -0.24))),
            RigCamera(WIDE, mounted(-90, (-0.12, 0, -0.12))),
        ]
    )
