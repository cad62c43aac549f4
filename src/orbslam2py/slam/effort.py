# SPDX-License-Identifier: BSD-3-Clause
"""How much work goes into the map; ``docs/guide/tuning.md#effort`` has what each gives."""

from __future__ import annotations

from enum import Enum

from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.thresholds import KeyframeThresholds


class Effort(str, Enum):
    """How often frames become keyframes, and whether all of them are matched with the map again."""

    FAST = "fast"
    NORMAL = "normal"
    THOROUGH = "thorough"

    def __str__(self) -> str:
        return self.value

    def keyframes(self, sensor: Sensor) -> KeyframeThresholds:
        """When a frame becomes a keyframe."""
        return (_WITH_DEPTH if sensor.has_depth else _MONOCULAR)[self]

    @property
    def looks_again(self) -> bool:
        """Whether every frame is matched with the map once more, when it has settled around it."""
        return self is Effort.THOROUGH


# More keyframes than normal, nearer to each other, bend a long path further.
_WITH_DEPTH = {
    Effort.FAST: KeyframeThresholds(spacing=4, share=0.6),
    Effort.NORMAL: KeyframeThresholds(spacing=2),
    Effort.THOROUGH: KeyframeThresholds(spacing=2),
}
_MONOCULAR = {
    Effort.FAST: KeyframeThresholds(share_monocular=0.8),
    Effort.NORMAL: KeyframeThresholds(),
    Effort.THOROUGH: KeyframeThresholds(),
}
