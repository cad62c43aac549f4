# SPDX-License-Identifier: BSD-3-Clause
"""A stereo camera with an IMU that has all faults of real ones, and counts what it delivered."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from orbslam2py import DatasetError, Settings
from orbslam2py.live import Sink, Stream
from orbslam2py.settings import ImuSettings

SIZE = (24, 32)  # rows, columns


@dataclass(frozen=True)
class Faults:
    """Frames at which something goes wrong, by their number."""

    #: Images of one side that never come.
    drops: dict[int, Stream] = field(default_factory=dict)
    #: Seconds by which the right image is taken later.
    skews: dict[int, float] = field(default_factory=dict)
    #: Seconds by which a frame comes late, with the stamp of its exposure.
    delays: dict[int, float] = field(default_factory=dict)
    #: Seconds by which the clock of the device jumps.
    jumps: dict[int, float] = field(default_factory=dict)
    #: Times that the camera cannot be opened after its cable was pulled.
    pulled: dict[int, int] = field(default_factory=dict)
    #: Frames, from this one on, for which it says nothing until it is started again.
    silent: frozenset[int] = frozenset()
    #: Frames with another size.
    other_size: frozenset[int] = frozenset()
    #: Frames that come a second time.
    doubled: frozenset[int] = frozenset()
    #: Where frames come this many times slower.
    slow: dict[int, float] = field(default_factory=dict)


class FaultyCamera:
    """Delivers `n` frames at a rate, and four samples of the IMU per frame; see `Faults`."""

    name, kind = "made:1", "made"

    def __init__(
        self,
        n: int = 100,
        rate: float = 100.0,
        faults: Faults | None = None,
        *,
        streams: tuple[Stream, ...] = ("left", "right", "imu"),
        settings: Settings | None = None,
        begin: float = 12.0,
        restarts_clock: bool = True,
        separate: bool = False,
        images: Callable[[int, Stream], np.ndarray] | None = None,
    ) -> None:
        self.streams = streams
        self._settings = settings
        self._n, self._step = n, 1 / rate
        self._faults = faults or Faults()
        self._begin = begin
        self._restarts_clock = restarts_clock
        self._separate = separate
        self._images = images or self.image
        self._next = 0
        self._refusals = 0
        self._shift = 0.0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._clock = self._first_start = 0.0
        self.n_started = 0
        #: What was delivered, by stream.
        self.delivered: Counter[str] = Counter()
        self.done = threading.Event()

    @staticmethod
    def image(number: int, stream: Stream) -> np.ndarray:
        """An image whose pixels tell its number and its side."""
        return np.full(SIZE, number % 200 + (50 if stream == "right" else 0), np.uint8)

    def settings(self) -> Settings | None:
        return self._settings

    def imu_settings(self) -> ImuSettings | None:
        return None

    def start(self, sink: Sink, /) -> None:
        if self._refusals:
            self._refusals -= 1
            raise DatasetError("made:1 is not there; plug it in")
        self.n_started += 1
        now = time.monotonic()
        if self.n_started == 1:
            self._first_start = now
        # A clock that goes on has counted the time in which the camera was away.
        away = 0.0 if self._restarts_clock else now - self._first_start
        self._clock = self._begin + away - self._step * self._next
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(sink, self._stop), name="made-camera", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, sink: Sink, stop: threading.Event) -> None:
        for number in self._numbers():
            faults = self._faults
            self._shift += faults.jumps.get(number, 0.0)
            if stop.wait(self._step * faults.slow.get(number, 1.0)):
                self._next = number  # it was not delivered
                return
            # By its number: the computer that runs the test may be busy.
            stamp = self._clock + self._step * (number + 1) + self._shift
            if number in faults.silent:
                stop.wait()
                return
            if stop.wait(faults.delays.get(number, 0.0)):
                return
            if "imu" in self.streams:
                self._send_imu(sink, stamp)
            self._send_images(sink, number, stamp)
            if number in faults.pulled:
                self._refusals = faults.pulled[number]
                sink.fault("was unplugged")
                return
        self.done.set()

    def _numbers(self) -> Iterator[int]:
        while self._next < self._n:
            self._next += 1
            yield self._next - 1

    def _send_imu(self, sink: Sink, stamp: float) -> None:
        times = stamp - self._step * np.array([0.75, 0.5, 0.25, 0.0])
        rows = np.column_stack([times, np.tile([0.1, 0.2, 0.3, 1.0, 2.0, 9.8], (4, 1))])
        self.delivered["imu"] += len(rows)
        if self._separate:
            # Twice as seldom, and around those of the gyro.
            sink.accel(np.column_stack([[times[0] - 1e-4, times[3] + 1e-4], rows[:2, 4:]]))
            sink.gyro(rows[:, :4])
        else:
            sink.imu(rows)

    def _send_images(self, sink: Sink, number: int, stamp: float) -> None:
        faults = self._faults
        for _ in range(1 + (number in faults.doubled)):
            for stream in self.streams:
                if stream == "imu" or faults.drops.get(number) == stream:
                    continue
                pixels = self._images(number, stream)
                if number in faults.other_size:
                    pixels = np.vstack([pixels, pixels])
                later = faults.skews.get(number, 0.0) if stream == "right" else 0.0
                self.delivered[stream] += 1
                sink.image(stream, pixels, stamp + later, exposure=time.monotonic() - 0.002)
