# SPDX-License-Identifier: BSD-3-Clause
"""Calibrations of raw stereo pairs, and what is seen through them."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from orbslam2py import CameraSettings, DepthSettings, OrbSettings, Sensor, Settings
from orbslam2py._arrays import FloatArray
from orbslam2py.settings.pair_cameras import cameras_of_pair
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

SIZE = (320, 240)


def extrinsics(baseline: float = 0.1) -> FloatArray:
    """From left to right camera coordinates; the cameras are turned by a degree."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array([0.01, 0.018, -0.007]))[0]
    T[:3, 3] = -T[:3, :3] @ [baseline, 0.001, -0.002]
    return T


def fisheye(degrees: float, cx: float = 161.0) -> CameraSettings:
    """An equidistant lens with a horizontal angle of view."""
    f = SIZE[0] / 2 / math.radians(degrees / 2)
    lens = (0.01, -0.003, 0.0, 0.0)
    return CameraSettings(
        *(f, f, cx, 118.5), width=SIZE[0], height=SIZE[1], model="kannala_brandt", lens=lens
    )


def pair_settings(
    left: CameraSettings, right: CameraSettings, T_right_left: FloatArray | None = None
) -> Settings:
    """Settings of a raw pair."""
    T = extrinsics() if T_right_left is None else T_right_left
    return Settings(
        sensor=Sensor.STEREO,
        **cameras_of_pair(left, right, T, SIZE).fields,
        orb=OrbSettings(n_features=500),
        depth=DepthSettings(close_factor=40.0),
    )


def fisheye_pair(degrees: float) -> Settings:
    """Settings of a pair with different centres."""
    return pair_settings(fisheye(degrees), fisheye(degrees, cx=157.5))


def distorted_pair() -> Settings:
    """Settings of a pair of pinhole cameras with radial distortion."""
    left = CameraSettings(200.0, 200.0, 161.0, 118.0, k1=-0.25, k2=0.06, width=320, height=240)
    return pair_settings(left, replace(left, fx=202.0, cx=157.0, k1=-0.22))


def seen_through(settings: Settings, frames: int = 2) -> SyntheticSequence:
    """A room through both lenses: raw images."""
    options = SyntheticOptions(world="room", sensor="stereo", frames=frames, lens_pair=settings)
    return SyntheticSequence(options)
