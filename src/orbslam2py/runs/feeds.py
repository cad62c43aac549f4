# SPDX-License-Identifier: BSD-3-Clause
"""Frames of a recording or a camera, in the order of a run."""

from __future__ import annotations

import contextlib
import math
import re
import threading
import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import FrameTimes, Images, LiveSource, Sequence
from orbslam2py.errors import DatasetError
from orbslam2py.runs.imu import ImuOfRun
from orbslam2py.runs.prefetch import prefetch
from orbslam2py.slam.frame_source import check_images

#: Seconds between two looks at whether the run was stopped.
_WAIT_SLICE = 0.2
#: A decimal number, as in the files.
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


@dataclass(frozen=True)
class FedFrame:
    """A frame on its way from the source to the system.

    Attributes
    ----------
    index
        Number in the sequence, from 0, also if the run skips frames; for a camera the number of
        images before.
    timestamp, text
        Time stamp in seconds, as a number and as text of the source.
    item
        The images; an exception if they could not be read.
    is_dropped
        Whether real time leaves no room for it.
    imu
        Samples of the IMU since the frame before, float64 (n, 7), also of a dropped frame; None
        without an IMU.
    times
        When a live frame passed its stages; None if it is not known.
    """

    index: int
    timestamp: float
    text: str
    item: Images | Exception
    is_dropped: bool = False
    imu: FloatArray | None = None
    times: FrameTimes | None = None


class RecordedFeed:
    """Frames of a sequence, read ahead.

    Parameters
    ----------
    sequence : Sequence
        Images and time stamps.
    indices : list of int
        Numbers of the frames in the sequence, in order.
    realtime : bool
        Play the time stamps, and drop frames that are overtaken.
    imu : ImuOfRun, optional
        The IMU whose samples come with the frames.

    Raises
    ------
    DatasetError
        If the time stamp of the first frame is no text.
    """

    is_live = False
    n_lost = 0

    def __init__(
        self,
        sequence: Sequence,
        indices: list[int],
        *,
        realtime: bool,
        imu: ImuOfRun | None = None,
    ) -> None:
        self._sequence = sequence
        self._imu = imu
        self._indices = indices
        self._realtime = realtime
        self._clock: _Clock | None = None
        self.n_frames: int | None = len(indices)
        # Before anything is written: all others are made in the same way.
        self._text(indices[0])

    def frames(self, stop: threading.Event) -> Generator[FedFrame, None, None]:
        """Yield the frames, in real time at their due times, until `stop` is set.

        Unreadable frames contain their error.

        Raises
        ------
        DatasetError
            If the sequence gives objects that are no images, or time stamps that are no text.
        """
        sequence = self._sequence
        clock = _Clock(sequence.timestamps, self._indices, stop) if self._realtime else None
        self._clock = clock
        before: float | None = None
        with contextlib.closing(prefetch(sequence.load, self._indices, stop)) as images:
            for position, (index, item) in enumerate(images):
                dropped = clock is not None and clock.must_drop(position)
                if stop.is_set():
                    return
                if not isinstance(item, Exception):
                    check_images(item, f"load({index})")
                timestamp = float(sequence.timestamps[index])
                samples = None if self._imu is None else self._imu.since(before, timestamp)
                before = timestamp
                yield FedFrame(index, timestamp, self._text(index), item, dropped, samples)

    def _text(self, index: int) -> str:
        return _time_text(self._sequence.timestamp_text(index), f"timestamp_text({index})")

    def delay(self, seconds: float) -> None:
        """Add a pause to the due times of the next frames."""
        if self._clock is not None:
            self._clock.delay(seconds)


class LiveFeed:
    """Images of a camera; each request gives the newest one.

    Parameters
    ----------
    camera : LiveSource
        The images.
    max_frames : int, optional
        End after this number of frames; otherwise only `stop` ends it.
    """

    is_live = True

    def __init__(self, camera: LiveSource, max_frames: int | None) -> None:
        self._camera = camera
        self._max_frames = max_frames
        self.n_frames: int | None = None

    @property
    def n_lost(self) -> int:
        """Number of images that came while an earlier one was processed."""
        return self._camera.n_dropped

    def frames(self, stop: threading.Event) -> Generator[FedFrame, None, None]:
        """Yield the newest image each time, until `stop` is set.

        Raises
        ------
        DatasetError
            If the camera cannot be opened, ends, or gives objects that are no images or time stamps
            that are no text.
        """
        index = 0
        with self._camera as camera:
            while not stop.is_set() and index != self._max_frames:
                frame = camera.take(_WAIT_SLICE)
                if frame is not None:
                    check_images(frame.images, "the camera")
                    text = _time_text(frame.text, "the camera")
                    yield FedFrame(
                        *(index, frame.timestamp, text, frame.images),
                        imu=frame.imu,
                        times=frame.times,
                    )
                    index += 1

    def delay(self, seconds: float) -> None:
        """Do nothing: a camera continues."""


def is_sequence(source: Sequence | LiveSource) -> TypeGuard[Sequence]:
    """Whether the source is a sequence of known length, not a camera."""
    return hasattr(source, "__len__")


def _time_text(text: Any, giver: str) -> str:
    """Check that a time stamp is text with a number: it is written to files unchanged.

    Python accepts more texts as numbers than other programs, for example with spaces and line ends.
    """
    if isinstance(text, str) and _NUMBER.fullmatch(text) and math.isfinite(float(text)):
        return text
    raise DatasetError(
        f"{giver} gave {shown(text)} for a time stamp; give the time in seconds as text, such as "
        "'1305031102.175304'"
    )


class _Clock:
    """Follows time stamps: a frame is dropped if the next one is due before it is taken."""

    def __init__(self, timestamps: FloatArray, indices: list[int], stop: threading.Event) -> None:
        self._due = np.asarray(timestamps)[indices]
        self._stop = stop
        self._offset: float | None = None

    def delay(self, seconds: float) -> None:
        """Wait for this time."""
        if self._offset is not None:
            self._offset += seconds

    def must_drop(self, position: int) -> bool:
        """Wait until the frame at a position of the run is due; True if its successor is too."""
        now = time.perf_counter()
        if self._offset is None:
            self._offset = now - float(self._due[position])
            return False
        early = float(self._due[position]) + self._offset - now
        if early > 0:
            self._stop.wait(early)
            return False
        has_next = position + 1 < len(self._due)
        return has_next and now >= float(self._due[position + 1]) + self._offset
