# SPDX-License-Identifier: BSD-3-Clause
"""Settings that are needed before the first image: sensor, camera, features, depth."""

from orbslam2py.settings.builtin import BUILTIN_NAMES
from orbslam2py.settings.camera_model import AngleOfView, CameraModel
from orbslam2py.settings.defaults import settings_for_camera
from orbslam2py.settings.fit import FitThresholds, Misfit
from orbslam2py.settings.groups import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    StereoRectification,
    ViewerSettings,
)
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.settings.imu_files import read_imu_settings
from orbslam2py.settings.imu_presets import ImuNoise, imu_noise
from orbslam2py.settings.rig import RigCamera
from orbslam2py.settings.right_camera import RightCamera
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings, builtin_settings, resolve_settings

__all__ = [
    "BUILTIN_NAMES",
    "AngleOfView",
    "CameraModel",
    "CameraRectification",
    "CameraSettings",
    "DepthSettings",
    "FitThresholds",
    "ImuNoise",
    "ImuSettings",
    "Misfit",
    "OrbSettings",
    "RigCamera",
    "RightCamera",
    "Sensor",
    "Settings",
    "StereoRectification",
    "ViewerSettings",
    "builtin_settings",
    "imu_noise",
    "read_imu_settings",
    "resolve_settings",
    "settings_for_camera",
]
