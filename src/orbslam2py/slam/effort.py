# SPDX-License-Identifier: BSD-3-Clause
"""How much work goes into the map; ``docs/guide/tuning.md#effort`` compares the presets."""

from __future__ import annotations

from enum import Enum


class Effort(str, Enum):
    """Presets of the configuration: see `orbslam2py.slam.config.PRESETS`."""

    FAST = "fast"
    LIGHT = "light"
    NORMAL = "normal"
    THOROUGH = "thorough"

    def __str__(self) -> str:
        return self.value
