# SPDX-License-Identifier: BSD-3-Clause
"""What a settings file can be used for."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from orbslam2py.errors import SettingsError
from orbslam2py.settings.builtin import builtin_sensors, is_builtin_name
from orbslam2py.settings.opencv_yaml import scan
from orbslam2py.settings.reader import read_groups, read_text
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings


def sensors_of(choice: str | PathLike[str]) -> tuple[Sensor, ...]:
    """Sensors for which a built-in name or a file is complete, the likely one first.

    A file with distortion, or for depth images, is not for a pair of rectified cameras.
    """
    if is_builtin_name(str(choice)):
        return builtin_sensors(str(choice))
    likely = likely_sensor(choice)
    others = [one for one in Sensor if one is Sensor.MONOCULAR or likely is Sensor.STEREO]
    sensors = [likely, *(one for one in others if one is not likely)]
    return tuple(sensor for sensor in sensors if _is_complete(Path(choice), sensor))


def likely_sensor(choice: str | PathLike[str]) -> Sensor:
    """Tell by its keys what a settings file was written for.

    Raises
    ------
    SettingsError
        If the file cannot be read.
    """
    if is_builtin_name(str(choice)):
        return builtin_sensors(str(choice))[0]
    keys = scan(read_text(Path(choice))).entries
    if "DepthMapFactor" in keys:
        return Sensor.RGBD
    return Sensor.STEREO if {"Camera.bf", "ThDepth"} & set(keys) else Sensor.MONOCULAR


def _is_complete(path: Path, sensor: Sensor) -> bool:
    try:
        groups = read_groups(path, sensor, allow_unknown=False, warn=lambda _: None)
        settings = Settings(sensor=sensor, **groups)
    except SettingsError:
        return False
    return sensor is not Sensor.STEREO or not settings.camera.is_distorted
