# SPDX-License-Identifier: BSD-3-Clause
"""The frames after a relocalization, or after a map began: more inliers are required."""

from __future__ import annotations

from dataclasses import dataclass, replace

from orbslam2py.slam.config import TrackingConfig


@dataclass(frozen=True)
class Probation:
    """Since when the camera is tracked again, and from which frame on more inliers are required."""

    since: int = 0
    """Frame of the last relocalization, or of the last map that began."""
    found_again: bool = False
    """It was a relocalization."""
    strict_from: int | None = None
    """For one second from this frame on more inliers are required; None: not at all."""
    strict_from_at_loss: int | None = None
    """`strict_from` when tracking was lost."""

    @classmethod
    def of_first_map(cls, *, has_depth: bool) -> Probation:
        """Before the first map: measured depths need no probation."""
        strict_from = None if has_depth else 0
        return cls(strict_from=strict_from, strict_from_at_loss=strict_from)

    def lost(self) -> Probation:
        """Tracking was lost; it continues as before if the camera is found where it is expected."""
        return replace(self, strict_from_at_loss=self.strict_from)

    def relocalized(self, frame_id: int, *, where_expected: bool = False) -> Probation:
        """Return the probation after a relocalization.

        Parameters
        ----------
        frame_id : int
            The frame that was relocalized.
        where_expected : bool
            Near the last known pose, or where the velocity led from there: the probation of before
            the loss continues. Elsewhere a new one begins.
        """
        strict_from = self.strict_from_at_loss if where_expected else frame_id
        return replace(self, since=frame_id, found_again=True, strict_from=strict_from)

    def map_begun(self, frame_id: int, *, has_depth: bool) -> Probation:
        """Return the probation after a map began that is not the first."""
        strict_from = self.strict_from if has_depth else frame_id
        return replace(self, since=frame_id, found_again=False, strict_from=strict_from)

    def has_just_begun(self, frame_id: int, limits: TrackingConfig) -> bool:
        """Whether this frame or the one right before was relocalized, or began a map."""
        return frame_id < self.since + limits.frames_after_relocalization

    def was_just_found(self, frame_id: int, limits: TrackingConfig) -> bool:
        """Whether this frame or the one right before was relocalized."""
        return self.found_again and self.has_just_begun(frame_id, limits)

    def required_inliers(self, frame_id: int, second: int, limits: TrackingConfig) -> int:
        """Return the number of inliers that a pose must have in the local map.

        Parameters
        ----------
        frame_id : int
            The frame.
        second : int
            Frames of one second.
        limits : TrackingConfig
            Thresholds.
        """
        if self.strict_from is not None and frame_id < self.strict_from + second:
            return limits.local_map_inliers_after_relocalization
        return limits.local_map_inliers
