# SPDX-License-Identifier: BSD-3-Clause
"""What tracking asks of whatever begins a map."""

from __future__ import annotations

from abc import ABC, abstractmethod

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.records import Reason


class Initializer(ABC):
    """Begins a map from the frames that come.

    One that begins a map with one frame keeps nothing from frame to frame: so are the defaults.
    """

    @abstractmethod
    def shows_enough(self, frame: core.TrackedFrame) -> bool:
        """Whether a frame has the keypoints that a map needs to begin."""

    @abstractmethod
    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Begin the map with this frame; or say why not (`Reason.NONE`: it has begun).

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        """

    @property
    def feature_factor(self) -> int:
        """How many features the next frame needs, in multiples of the settings' number."""
        return 1

    def lines(self) -> FloatArray | None:
        """What the last frame was matched with, for those who watch.

        Returns
        -------
        array (m, 4) or None
            Pixels of the images as given: x and y in the first view, then in the last frame. None
            where a map does not begin from two views.
        """
        return None

    def take_earlier(self) -> tuple[core.TrackedFrame, ...]:
        """Frames before the one that began the map, with their poses in it, in order; once."""
        return ()

    def n_between(self, map_index: int) -> int:
        """Living keyframes that a map began with, beyond those that it needs."""
        return 0

    def remembered(self) -> list[core.Frame]:
        """What a new map may begin from, if the young one came to nothing."""
        return []

    def remember(self, frame: core.TrackedFrame) -> None:  # noqa: B027
        """Keep a frame that was tracked in a young map, which may yet come to nothing."""

    def reset(self) -> None:  # noqa: B027
        """Forget the frames before."""

    def restart(self, frames: list[core.Frame]) -> None:  # noqa: B027
        """Begin anew, with frames remembered from before."""
