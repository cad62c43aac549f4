# SPDX-License-Identifier: BSD-3-Clause
"""What tracking asks of whatever begins a map."""

from __future__ import annotations

from typing import Protocol

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.records import Reason


class Initializer(Protocol):
    """Begins a map from the frames that come.

    Attributes
    ----------
    feature_factor
        How many features the next frame needs, in multiples of the settings' number.
    watches_map
        Whether the map that has begun is so young that later frames may contradict it.
    """

    @property
    def feature_factor(self) -> int: ...  # noqa: D102
    @property
    def watches_map(self) -> bool: ...  # noqa: D102

    def reset(self) -> None:
        """Forget the frames before."""
        ...

    def lines(self) -> FloatArray | None:
        """What the last frame was matched with, for those who watch.

        Returns
        -------
        array (m, 4) or None
            Pixels of the images as given: x and y in the first view, then in the last frame. None
            where a map does not begin from two views.
        """
        ...

    def shows_enough(self, frame: core.TrackedFrame) -> bool:
        """Whether a frame has the keypoints that a map needs to begin."""
        ...

    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Begin the map with this frame; or say why not (`Reason.NONE`: it has begun).

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        """
        ...

    def take_earlier(self) -> tuple[core.TrackedFrame, ...]:
        """Frames before the one that began the map, with their poses in it, in order; once."""
        ...

    def n_between(self, map_index: int) -> int:
        """Living keyframes that a map began with, beyond those that it needs."""
        ...

    def remember(self, frame: core.TrackedFrame) -> None:
        """A frame that was tracked in a young map, which may yet come to nothing."""
        ...

    def contradicts(self, frame: core.TrackedFrame) -> bool:
        """Whether this frame and those before it, tracked in a young map, prove it wrong."""
        ...

    def believe_map(self) -> None:
        """No later frame contradicts the map that has begun."""
        ...

    def remembered(self) -> list[core.Frame]:
        """What a new map may begin from, if the young one came to nothing."""
        ...

    def restart(self, frames: list[core.Frame]) -> None:
        """Begin anew, with frames remembered from before."""
        ...
