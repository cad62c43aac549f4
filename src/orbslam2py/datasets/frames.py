# SPDX-License-Identifier: BSD-3-Clause
"""Sequences in a ``for`` loop: frames in order, with their time stamps."""

from __future__ import annotations

from collections.abc import Iterator

from orbslam2py.datasets.base import Frame, Sequence


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
            From `Sequence.load`; an error ends the loop.
        """
        for index, timestamp in enumerate(self.timestamps.tolist()):
            yield Frame(index, timestamp, self.timestamp_text(index), self.load(index))
