# SPDX-License-Identifier: BSD-3-Clause
"""KITTI's calibration: ``calib.txt`` of the odometry benchmark, ``calib_cam_to_cam.txt``."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import checked_numbers, checked_size
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings, OrbSettings, Sensor, Settings, settings_for_camera
from orbslam2py.settings.keys import focal_problems

_PROJECTION = re.compile(r"^P(?:_rect_0)?(\d):(.*)$", re.MULTILINE)
_SIZE = re.compile(r"^S_rect_0(\d):(.*)$", re.MULTILINE)
_RATE = 10.0
_FEATURES = 2000


def kitti_settings(
    path: Path, text: str, number: int | None, sensor: Sensor | None, fps: float | None
) -> Settings:
    """Make settings of rectified cameras: of one, or of one and the next as a pair.

    Parameters
    ----------
    path, text
        The file, for messages, and its text.
    number
        Which camera; None for the first, and its pair if there is one.
    sensor
        What the settings are for; None for the pair, or for the camera whose number is given.
    fps
        Frames per second; None for 10.

    Raises
    ------
    SettingsError
        If values are missing or wrong.
    """
    projections = {
        int(match[1]): checked_numbers(path, f"P{match[1]}", match[2].split(), (12,)).reshape(3, 4)
        for match in _PROJECTION.finditer(text)
    }
    if not projections:
        raise SettingsError(f"{path} has no projection matrix P0; is it a calib.txt of KITTI?")
    first = min(projections) if number is None else number
    if first not in projections:
        there = ", ".join(f"P{one}" for one in sorted(projections))
        raise SettingsError(f"{path} has no P{first}; give --camera with one there is: {there}")
    if sensor is Sensor.STEREO and first + 1 not in projections:
        raise SettingsError(f"{path} has no P{first + 1}, the right camera that stereo needs")
    camera = _camera(path, text, first, projections[first], _RATE if fps is None else fps)
    orb = OrbSettings(n_features=_FEATURES)
    as_it_is = sensor is None and number is None
    pair = sensor is Sensor.STEREO or (as_it_is and first + 1 in projections)
    if not pair:
        return settings_for_camera(camera, Sensor.MONOCULAR, orb=orb)
    bf = float(projections[first][0, 3] - projections[first + 1][0, 3])
    if bf <= 0:
        raise SettingsError(f"{path}: P{first + 1} does not stand to the right of P{first}")
    return settings_for_camera(replace(camera, bf=bf), Sensor.STEREO, orb=orb)


def _camera(path: Path, text: str, number: int, P: FloatArray, fps: float) -> CameraSettings:
    sizes = {int(match[1]): match[2].split() for match in _SIZE.finditer(text)}
    width, height = None, None
    if number in sizes:
        found = checked_numbers(path, f"S_rect_0{number}", sizes[number], (2,))
        width, height = checked_size(path, found.tolist())
    for problem in focal_problems(f"P{number}", P):
        raise SettingsError(f"{path}: {problem}")
    fx, fy, cx, cy = (float(value) for value in np.array([P[0, 0], P[1, 1], P[0, 2], P[1, 2]]))
    return CameraSettings(fx, fy, cx, cy, width=width, height=height, fps=fps, rgb=True)
