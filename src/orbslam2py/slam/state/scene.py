# SPDX-License-Identifier: BSD-3-Clause
"""Running means over accepted frames, with which a new frame is compared.

``docs/method/tracking.md#evidence``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbslam2py._values import replace

_GAIN = 0.25  # weight of the newest frame in the running means: they forget within some frames


@dataclass(frozen=True)
class PoseStatistics:
    """Inliers of a pose, visibility ratio, and standard deviation of the position."""

    n_inliers: float
    found: float
    deviation: float

    def moved_to(self, other: PoseStatistics) -> PoseStatistics:
        """Return the means, moved towards the values of a newer frame."""
        return PoseStatistics(
            self.n_inliers + _GAIN * (other.n_inliers - self.n_inliers),
            self.found + _GAIN * (other.found - self.found),
            self.deviation + _GAIN * (other.deviation - self.deviation),
        )


@dataclass(frozen=True)
class SceneStatistics:
    """Usual values in the frames before: of the scene, and of the images."""

    usual: PoseStatistics | None = None
    """Means of frames with strong evidence at this place; None: not known."""
    error: float | None = None
    """Mean of the median match errors, in standard deviations; it depends on camera and images, not
    on the place. None: not known."""

    def elsewhere(self) -> SceneStatistics:
        """Return the state with the camera at another place, or in another map."""
        return replace(self, usual=None)

    def with_pose(self, pose: PoseStatistics) -> SceneStatistics:
        """Return the statistics with an accepted frame of strong evidence."""
        usual = pose if self.usual is None else self.usual.moved_to(pose)
        return replace(self, usual=usual)

    def with_error(self, error: float) -> SceneStatistics:
        """Return the statistics with the median match error of any accepted frame."""
        if not math.isfinite(error):
            return self
        usual = error if self.error is None else self.error
        return replace(self, error=usual + _GAIN * (error - usual))
