# SPDX-License-Identifier: BSD-3-Clause
"""Interface between tracking and the initializers."""

from __future__ import annotations

from abc import ABC, abstractmethod

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.records import Reason


class Initializer(ABC):
    """Begins a map from incoming frames.

    The defaults fit an initializer that needs one frame and keeps none.
    """

    @abstractmethod
    def shows_enough(self, frame: core.TrackedFrame) -> bool:
        """Return whether a frame has enough keypoints to begin a map."""

    @abstractmethod
    def try_initialize(self, frame: core.TrackedFrame, T_cw: core.Pose | None = None) -> Reason:
        """Begin the map with this frame; or return a reason (`Reason.NONE`: it has begun).

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        T_cw : Pose or None
            The frame's pose in the new map, if an IMU knows it. A single camera, whose map has no
            scale yet, does not use it.
        """

    @property
    def feature_factor(self) -> int:
        """Return the features of the next frame, in multiples of the settings' number."""
        return 1

    def lines(self) -> FloatArray | None:
        """Return the matches of the last frame, for viewers.

        Returns
        -------
        array (m, 4) or None
            Pixels of the images as given: x and y in the first view, then in the last frame. None
            if a map does not begin from two views.
        """
        return None

    def take_earlier(self) -> tuple[core.TrackedFrame, ...]:
        """Return the frames before the one that began the map, with poses in it, in order; once."""
        return ()

    def n_between(self) -> int:
        """Living keyframes of the start of the active map, beyond those that a map needs."""
        return 0

    def remembered(self) -> list[core.Frame]:
        """Return the frames that a new map may begin from, if the young map is dropped."""
        return []

    def remember(self, frame: core.TrackedFrame) -> None:  # noqa: B027
        """Keep a frame that was tracked in a young map, in case this map is dropped."""

    def reset(self) -> None:  # noqa: B027
        """Forget the frames before."""

    def restart(self, frames: list[core.Frame]) -> None:  # noqa: B027
        """Start again, with frames of an earlier attempt."""
