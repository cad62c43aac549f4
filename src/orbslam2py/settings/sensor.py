# SPDX-License-Identifier: BSD-3-Clause
"""The kinds of sensors."""

from __future__ import annotations

from enum import Enum, EnumMeta
from typing import Any

from orbslam2py._arguments import shown
from orbslam2py.errors import SettingsError


class _NamedByText(EnumMeta):
    """Refuses objects that are no text, because arrays cannot be compared with members."""

    def __call__(cls, value: Any, *more: Any, **named: Any) -> Any:
        if not isinstance(value, str):
            raise _unknown(value)
        return super().__call__(value, *more, **named)


class Sensor(str, Enum, metaclass=_NamedByText):
    """The sensor; the values are the names on the command line."""

    MONOCULAR = "mono"
    STEREO = "stereo"
    RGBD = "rgbd"
    RIG = "rig"

    @classmethod
    def _missing_(cls, value: object) -> Sensor:
        """Accept other spellings: ``"RGB-D"``, ``"monocular"``."""
        text = str(value).lower().replace("-", "").replace(" ", "")
        for sensor in cls:
            if text in (sensor.value, sensor.name.lower()):
                return sensor
        raise _unknown(value)

    @property
    def has_depth(self) -> bool:
        """Whether the images of one moment give metric depth (all but a single camera)."""
        return self is not Sensor.MONOCULAR

    def __str__(self) -> str:
        return self.value


#: All but rigs, whose settings describe several cameras.
WITHOUT_RIG = (Sensor.MONOCULAR, Sensor.STEREO, Sensor.RGBD)


def _unknown(value: object) -> SettingsError:
    names = ", ".join(map(str, Sensor))
    return SettingsError(f"the sensor is {shown(value)}; give one of {names}")
