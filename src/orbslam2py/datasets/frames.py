# SPDX-License-Identifier: BSD-3-Clause
"""Sequences in a ``for`` loop: a frame after the other, with its time stamp."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from orbslam2py.datasets.base import Images, Sequence


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of a sequence, as a loop over the sequence gives it.

    Attributes
    ----------
    index
        Place in the sequence, from 0.
    timestamp
        Seconds.
    text
        The time stamp in decimal seconds, with all digits of the source.
    images
        What the camera saw, as the tracking calls take it.
    """

    index: int
    timestamp: float
    text: str
    images: Images


class FramesInOrder:
    """Makes a class with the members of `Sequence` iterable.

    >>> for frame in sequence:  # doctest: +SKIP
    ...     slam.track_monocular(frame.images.image, frame.timestamp)
    """

    def __iter__(self: Sequence) -> Iterator[Frame]:
        """Read the frames one after the other, from the first.

        Raises
        ------
        DatasetError, ImageError
            As from `Sequence.load`; the loop ends with it.
        """
        for index, timestamp in enumerate(self.timestamps.tolist()):
            yield Frame(index, timestamp, self.timestamp_text(index), self.load(index))
