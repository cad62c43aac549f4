# SPDX-License-Identifier: BSD-3-Clause
"""Sequences in a ``for`` loop: frames in order, with their time stamps."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from functools import cached_property

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.base import Frame, Sequence
from orbslam2py.datasets.imu import imu_of, imu_settings_of
from orbslam2py.errors import SettingsError
from orbslam2py.inertial.samples import ImuSamples


class ImuOfFrames:
    """Samples of a sequence's IMU, frame by frame; read when the first are asked for."""

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence

    @cached_property
    def _samples(self) -> ImuSamples | None:
        return imu_of(self._sequence)

    @cached_property
    def _offset(self) -> float:
        try:
            settings = imu_settings_of(self._sequence)
        except SettingsError:  # the caller reports it
            return 0.0
        return 0.0 if settings is None else settings.time_offset

    def since(self, before: float | None, timestamp: float) -> FloatArray | None:
        """Samples from one frame to the next [s]; see `ImuSamples.since`."""
        if self._samples is None:
            return None
        begin = None if before is None else before + self._offset
        return self._samples.since(begin, timestamp + self._offset)


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
        imu, before = ImuOfFrames(self), None
        for index, timestamp in enumerate(self.timestamps.tolist()):
            read = functools.partial(imu.since, before, timestamp)
            before = timestamp
            yield Frame(index, timestamp, self.timestamp_text(index), self.load(index), read)
