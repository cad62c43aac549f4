# SPDX-License-Identifier: BSD-3-Clause
"""The three kinds of cameras the system knows."""

from __future__ import annotations

from enum import Enum


class Sensor(str, Enum):
    """What delivers the images; the values are the names used on the command line."""

    MONOCULAR = "mono"
    STEREO = "stereo"
    RGBD = "rgbd"

    @property
    def has_depth(self) -> bool:
        """Whether a single image gives metric depth (stereo and RGB-D)."""
        return self is not Sensor.MONOCULAR

    def __str__(self) -> str:
        return self.value
