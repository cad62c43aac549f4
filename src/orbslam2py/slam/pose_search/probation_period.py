# SPDX-License-Identifier: BSD-3-Clause
"""The frames after the camera was found again, or a map began."""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py.slam.config import TrackingConfig


class ProbationPeriod:
    """How long ago the camera was found again, or a map began, and what is asked of frames since.

    Parameters
    ----------
    n_frames : int
        Frames of one second, during which a relocalization has to prove itself, unless it was
        expected there.
    has_depth : bool
        Whether frames measure depths: then a new map has nothing to prove, its points lie where
        they were measured.
    config : TrackingConfig
        Limits.
    """

    def __init__(self, n_frames: int, config: TrackingConfig, *, has_depth: bool) -> None:
        self._n_frames = n_frames
        self._limits = config
        self._has_depth = has_depth
        self.reset()

    def reset(self) -> None:
        """Nothing was found or begun yet."""
        # Where the camera was last found again, or a map began. 0 at the beginning.
        self._frame_id = 0
        self._was_found_again = False
        self._proves_from = self._proves_from_at_loss = None if self._has_depth else 0

    def lose(self) -> None:
        """Tracking was lost, and goes on as before if it is found where that is expected."""
        self._proves_from_at_loss = self._proves_from

    def found_again(self, frame: core.TrackedFrame, *, where_expected: bool = False) -> None:
        """The camera was found again in this frame.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        where_expected : bool
            Where it was just lost, or its motion led from there: it goes on as before the loss.
            Elsewhere it has to prove itself for a second.
        """
        self._frame_id = frame.id
        self._was_found_again = True
        self._proves_from = self._proves_from_at_loss if where_expected else frame.id

    def map_begun(self, frame_id: int) -> None:
        """A map beside others, or after one that came to nothing, has begun with this frame."""
        self._frame_id = frame_id
        self._was_found_again = False
        if not self._has_depth:
            self._proves_from = frame_id

    def has_just_begun(self, frame: core.TrackedFrame) -> bool:
        """Whether the camera was found again, or the map began, with this frame or right before."""
        return frame.id < self._frame_id + self._limits.frames_after_relocalization

    def was_just_found(self, frame: core.TrackedFrame) -> bool:
        """Whether the camera was found again in this frame or right before it."""
        return self._was_found_again and self.has_just_begun(frame)

    def inliers_asked(self, frame: core.TrackedFrame) -> int:
        """How many inliers a frame's pose is to have when the local map was searched."""
        proves_from = self._proves_from
        if proves_from is not None and frame.id < proves_from + self._n_frames:
            return self._limits.local_map_inliers_after_relocalization
        return self._limits.local_map_inliers
