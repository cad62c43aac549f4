# SPDX-License-Identifier: BSD-3-Clause
"""The three kinds of cameras the system knows."""

from __future__ import annotations

from enum import Enum

from orbslam2py.errors import SettingsError


class Sensor(str, Enum):
    """What delivers the images; the values are the names used on the command line."""

    MONOCULAR = "mono"
    STEREO = "stereo"
    RGBD = "rgbd"

    @classmethod
    def _missing_(cls, value: object) -> Sensor:
        """Take other spellings: ``"RGB-D"``, ``"monocular"``."""
        text = str(value).lower().replace("-", "").replace(" ", "")
        for sensor in cls:
            if text in (sensor.value, sensor.name.lower()):
                return sensor
        raise SettingsError(f"no sensor {value!r}; there are: {', '.join(map(str, cls))}")

    @property
    def has_depth(self) -> bool:
        """Whether a single image gives metric depth (stereo and RGB-D)."""
        return self is not Sensor.MONOCULAR

    def __str__(self) -> str:
        return self.value
