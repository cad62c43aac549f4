# SPDX-License-Identifier: BSD-3-Clause
"""Running means over accepted frames, with which a new frame is compared.

``docs/method/tracking.md#evidence``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from orbslam2py._arrays import FloatArray
from orbslam2py.slam.config import AcceptanceConfig


@dataclass(frozen=True)
class PoseStatistics:
    """Inliers of a pose, share of the predicted points that was found, and position deviation."""

    n_inliers: float
    found: float
    deviation: float

    def moved_to(self, other: PoseStatistics, gain: float) -> PoseStatistics:
        """A step towards those of a newer frame."""
        return PoseStatistics(
            self.n_inliers + gain * (other.n_inliers - self.n_inliers),
            self.found + gain * (other.found - self.found),
            self.deviation + gain * (other.deviation - self.deviation),
        )


@dataclass(frozen=True)
class MotionInnovation:
    """Mean squares of the innovation: from the pose of a frame to the one predicted for it.

    Rotation and translation are separate, because their units differ.
    """

    rotation: float = 0.0
    """Square of the angle [rad^2]."""
    translation: float = 0.0
    """Square of the length [m^2], for one camera in units of the map."""
    n_seen: int = 0
    """Frames."""

    def is_known(self, limits: AcceptanceConfig) -> bool:
        """Whether enough frames were seen."""
        return self.n_seen >= limits.changes_seen

    def excess(self, innovation: FloatArray, limits: AcceptanceConfig) -> FloatArray | None:
        """Return the part (6,) of an innovation that exceeds the usual; None where none does.

        The share is that of rotation or translation, whichever exceeds its mean by more: a wrong
        rotation is compensated by a wrong translation.

        Parameters
        ----------
        innovation : array of float64, (6,)
            Of a frame.
        limits : AcceptanceConfig
            Thresholds.
        """
        if not self.is_known(limits):
            return None
        rotation, translation = _squares(innovation)
        least = min(_ratio(self.rotation, rotation), _ratio(self.translation, translation))
        share = 1.0 - limits.usual_changes * math.sqrt(least)
        return None if share <= 0 else share * innovation

    def after(self, innovation: FloatArray, limits: AcceptanceConfig) -> MotionInnovation:
        """Return the means with an accepted frame; a sudden innovation moves them little.

        Parameters
        ----------
        innovation : array of float64, (6,)
            Of the frame.
        limits : AcceptanceConfig
            Thresholds.
        """
        rotation, translation = _squares(innovation)
        # After complete rest the means are 0; a multiple of 0 would stay 0 for ever.
        most = limits.sudden_change**2
        if self.rotation > 0:
            rotation = min(rotation, most * self.rotation)
        if self.translation > 0:
            translation = min(translation, most * self.translation)
        gain = max(limits.gain, 1.0 / (self.n_seen + 1))
        return MotionInnovation(
            self.rotation + gain * (rotation - self.rotation),
            self.translation + gain * (translation - self.translation),
            self.n_seen + 1,
        )


@dataclass(frozen=True)
class SceneStatistics:
    """What is usual in the frames before: of the scene, of the images, and of the motion."""

    usual: PoseStatistics | None = None
    """Of frames with strong evidence in this place; None: not known."""
    error: float | None = None
    """Median match error, in standard deviations; it depends on camera and images, not on the
    place. None: not known."""
    error_spread: float = 0.0
    """Mean absolute deviation of that error."""
    innovation: MotionInnovation = field(default_factory=MotionInnovation)
    """In this map: another map of a single camera has another scale."""

    def elsewhere(self) -> SceneStatistics:
        """The camera is in another place, or in another map."""
        return replace(self, usual=None, innovation=MotionInnovation())

    def is_sudden_error(self, error: float, limits: AcceptanceConfig) -> bool:
        """Whether a median match error exceeds the mean by more than it varies."""
        usual = self.error
        if usual is None or usual <= 0:
            return False
        return error > max(
            limits.weak_error * usual, usual + limits.weak_error_spreads * self.error_spread
        )

    def with_pose(self, pose: PoseStatistics, limits: AcceptanceConfig) -> SceneStatistics:
        """The statistics with an accepted frame of strong evidence."""
        usual = pose if self.usual is None else self.usual.moved_to(pose, limits.gain)
        return replace(self, usual=usual)

    def with_frame(
        self, error: float, innovation: FloatArray | None, limits: AcceptanceConfig
    ) -> SceneStatistics:
        """The statistics with any accepted frame.

        Parameters
        ----------
        error : float
            Its median match error, in standard deviations.
        innovation : array of float64, (6,), or None
            Of its motion, if the velocity was known.
        limits : AcceptanceConfig
            Thresholds.
        """
        known = self.innovation
        if innovation is not None:
            known = known.after(innovation, limits)
        if not math.isfinite(error):
            return replace(self, innovation=known)
        gain = limits.slow_gain if self.is_sudden_error(error, limits) else limits.gain
        usual = error if self.error is None else self.error
        return replace(
            self,
            innovation=known,
            error=usual + gain * (error - usual),
            error_spread=self.error_spread + gain * (abs(error - usual) - self.error_spread),
        )


def _squares(innovation: FloatArray) -> tuple[float, float]:
    # Six numbers, in every frame: faster without NumPy.
    a, b, c, x, y, z = innovation.tolist()
    return a * a + b * b + c * c, x * x + y * y + z * z


def _ratio(usual: float, now: float) -> float:
    """The mean square by the square of this frame; infinite for rest, which never exceeds it."""
    return usual / now if now > 0 else math.inf
