# SPDX-License-Identifier: BSD-3-Clause
"""The sensors that a settings file can be used for."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from orbslam2py._arguments import path_of
from orbslam2py.errors import SettingsError
from orbslam2py.settings.builtin import builtin_sensors, is_builtin_name
from orbslam2py.settings.fit import find_misfit, known_camera
from orbslam2py.settings.groups import CameraRectification, CameraSettings
from orbslam2py.settings.opencv_yaml import scan
from orbslam2py.settings.pair_views import LEAST_OVERLAP, views_of_pair
from orbslam2py.settings.reader import groups_of_text, read_text
from orbslam2py.settings.rig_file import is_rig_text, rig_of_text
from orbslam2py.settings.sensor import WITHOUT_RIG, Sensor
from orbslam2py.settings.settings import (
    Settings,
    builtin_settings,
    looks_like_path,
    resolve_settings,
)
from orbslam2py.settings.translation import translate

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ChosenSettings:
    """Built-in settings, or a file whose text is read only once, because it may be a pipe.

    Attributes
    ----------
    choice
        The built-in name, or the path of the file.
    text
        The text of the file; None for built-in settings.
    """

    choice: str
    text: str | None

    def load(self, sensor: Sensor) -> Settings:
        """Make the settings for a sensor; see `Settings.load`."""
        if self.text is None:
            return resolve_settings(self.choice, sensor)
        return Settings.from_yaml(self.text, sensor, source=self.choice)

    @property
    def likely_sensor(self) -> Sensor:
        """Return the sensor that the keys of the file suggest."""
        if self.text is None:
            return builtin_sensors(self.choice)[0]
        if is_rig_text(self.text):
            return Sensor.RIG
        keys = translate(scan(self.text), Sensor.MONOCULAR).entries
        if "DepthMapFactor" in keys:
            return Sensor.RGBD
        return Sensor.STEREO if {"Camera.bf", "ThDepth"} & set(keys) else Sensor.MONOCULAR

    def usable_sensors(self) -> tuple[Sensor, ...]:
        """Return the sensors for which they are complete, the most likely one first.

        A file with distortion, or for depth images, does not count as one for a rectified pair,
        although it may be complete for it.
        """
        if self.text is None:
            return builtin_sensors(self.choice)
        likely = self.likely_sensor
        if likely is Sensor.RIG:
            return (likely,) if _is_complete(self.text, self.choice, likely) else ()
        others = [one for one in WITHOUT_RIG if one is Sensor.MONOCULAR or likely is Sensor.STEREO]
        sensors = [likely, *(one for one in others if one is not likely)]
        return tuple(sensor for sensor in sensors if _is_complete(self.text, self.choice, sensor))


def read_choice(choice: str | PathLike[str]) -> ChosenSettings:
    """Find built-in settings, or read a settings file.

    Raises
    ------
    SettingsError
        If it is neither a name nor a readable file.
    """
    if is_builtin_name(str(choice)):
        return ChosenSettings(str(choice), None)
    if not looks_like_path(choice):
        resolve_settings(choice, Sensor.MONOCULAR)  # says which names there are
    path = path_of(choice, "the settings file", SettingsError)
    return ChosenSettings(str(path), read_text(path))


def doubts_of_size(settings: Settings) -> list[str]:
    """Return problems of cameras that do not fit the image size in the settings."""
    found = []
    if settings.rectification is not None:
        for side in ("left", "right"):
            raw = Settings(Sensor.MONOCULAR, _raw_camera(getattr(settings.rectification, side)))
            found += _misfits(f"{side.upper()}.K: ", raw)
    # Of wrong cameras nothing else can come than a wrong rectified one.
    return found or _doubts_of_views(settings) or _misfits_of_camera(settings)


def warn_of_doubts(settings: Settings, source: str | PathLike[str]) -> None:
    """Log values that are allowed, but probably wrong.

    Parameters
    ----------
    settings
        The settings.
    source
        The source or the file of the settings, for the messages.
    """
    for doubt in (*settings.doubts(), *doubts_of_size(settings)):
        _log.warning("%s: %s", source, doubt)


def _doubts_of_views(settings: Settings) -> list[str]:
    """Return a warning about a pair with very different viewing directions."""
    if settings.rectification is None:
        return []
    views = views_of_pair(settings.rectification)
    if views.overlap >= LEAST_OVERLAP:
        return []
    return [
        f"{views}; so few points have depth: turn the cameras the same way and calibrate them "
        "again, or use one of them (import-camera with --camera 0)"
    ]


def _misfits_of_camera(settings: Settings) -> list[str]:
    return [] if _is_published(settings) else _misfits("", settings)


def _misfits(name: str, settings: Settings) -> list[str]:
    camera = settings.camera
    if camera.width is None or camera.height is None:
        return []
    misfit = find_misfit(settings, (camera.width, camera.height))
    return [] if misfit is None else [f"{name}{misfit}"]


def _is_published(settings: Settings) -> bool:
    """Return whether numbers and size are those of a data set; KITTI's size serves three."""
    name = known_camera(settings.camera)
    if name is None:
        return False
    known = builtin_settings(name, builtin_sensors(name)[0]).camera
    size = (settings.camera.width, settings.camera.height)
    return size == (known.width, known.height)


def _raw_camera(one: CameraRectification) -> CameraSettings:
    fx, fy, cx, cy = (float(one.K[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    # No camera centre is farther away than settings allow.
    cx, cy = (max(-1e5, min(1e5, centre)) for centre in (cx, cy))
    return CameraSettings(fx, fy, cx, cy, width=one.width, height=one.height)


def _is_complete(text: str, source: str, sensor: Sensor) -> bool:
    try:
        read = rig_of_text if sensor is Sensor.RIG else groups_of_text
        groups = read(text, Path(source), sensor, allow_unknown=False, warn=lambda _: None)
        settings = Settings(sensor=sensor, **groups)
    except SettingsError:
        return False
    return sensor is not Sensor.STEREO or not settings.camera.is_distorted
