# SPDX-License-Identifier: BSD-3-Clause
"""The sink of a device: from single images and samples to frames that wait for a reader."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.live.clock import DeviceClock
from orbslam2py.live.device import Stream
from orbslam2py.live.imu_join import ImuJoin, ImuQueue
from orbslam2py.live.pairing import Pairing, Part, Parts
from orbslam2py.live.rate import RateWatch
from orbslam2py.live.reports import Reports

#: Longest wait for samples of the IMU up to the time of a frame, seconds.
_IMU_WAIT = 0.1

#: Gets every complete frame and every sample, also those that no reader takes; see `recorder`.
Tap = Callable[[Parts | None, FloatArray | None], None]


class Inlet:
    """Receives the data of a device, in its threads; see `device.Sink`.

    Parameters
    ----------
    streams
        The streams of the device.
    max_skew
        Largest time between the images of one moment, seconds.
    rate
        Expected frames per second.
    room
        Most frames that wait for the reader; the oldest is dropped.
    reports
        Where to report to.
    """

    def __init__(
        self,
        streams: tuple[Stream, ...],
        max_skew: float,
        rate: float,
        room: int,
        reports: Reports,
    ) -> None:
        self._reports = reports
        self._images = tuple(stream for stream in streams if stream != "imu")
        self.has_imu = "imu" in streams
        # Guards all fields below; notified when a frame, samples or a fault came.
        self.changed = threading.Condition()
        self._clock = DeviceClock(lambda text: reports.warn("clock", text))
        self.pairing = Pairing(self._images, max_skew, reports.warn)
        self.rate = RateWatch(rate)
        self._join = ImuJoin()
        self.imu_queue = ImuQueue()
        self._waiting: deque[tuple[Parts, float]] = deque()
        self._room = room
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._closed = True
        self.tap: Tap | None = None
        self.fault_text: str | None = None
        #: When the last complete frame came, on the clock of ``time.monotonic()``.
        self.last_frame: float | None = None
        self.n_frames = 0
        self.n_dropped = 0
        self.n_of_other_size = 0
        self.n_broken = 0
        self.n_imu_left_out = 0
        #: Since when all images have another size, on the clock of ``time.monotonic()``.
        self.other_size_since: float | None = None

    # ---- called by the device --------------------------------------------------------------------
    def image(
        self,
        stream: Stream,
        array: NDArray[Any],
        stamp: float,
        /,
        exposure: float | None = None,
    ) -> None:
        """Take an image."""
        arrival = time.monotonic()
        with self.changed:
            if self._closed or stream not in self._images:
                return
            if not np.isfinite(stamp) or array.size == 0:
                self.n_broken += 1
                self._reports.warn("broken", f"sent a {stream} image without pixels or time")
                return
            if not self._has_usual_size(stream, array, arrival):
                return
            at = self._clock.time_of(stream, float(stamp), arrival)
            if at is None:
                self._reports.warn(
                    "late", f"sent a {stream} image whose stamp is not after the one before"
                )
                return
            part = Part(array, at, float(stamp), exposure, arrival)
            for frame in self.pairing.add(stream, part):
                self._add_frame(frame, arrival)

    def imu(self, samples: FloatArray, /) -> None:
        """Take samples of an IMU."""
        with self.changed:
            if not self._closed:
                self._add_imu(self._timed("imu", samples, 7))

    def gyro(self, samples: FloatArray, /) -> None:
        """Take angular rates."""
        with self.changed:
            if not self._closed:
                self._add_imu(self._join.add_gyro(self._timed("gyro", samples, 4)))

    def accel(self, samples: FloatArray, /) -> None:
        """Take specific forces."""
        with self.changed:
            if not self._closed:
                self._add_imu(self._join.add_accel(self._timed("accel", samples, 4)))

    def fault(self, text: str, /) -> None:
        """Note that the device is lost."""
        with self.changed:
            if not self._closed and self.fault_text is None:
                self.fault_text = text
                self.changed.notify_all()

    def warning(self, text: str, /) -> None:
        """Report a message of the device."""
        self._reports.warn(text, text)

    # ---- called by the stream --------------------------------------------------------------------
    def begin(self) -> None:
        """Accept data from now on; earlier data do not count as lost."""
        with self.changed:
            self._closed = False

    def next_frame(self, timeout: float) -> tuple[Parts, float, FloatArray | None] | None:
        """Wait for a frame, and for the samples of the IMU up to its time.

        Parameters
        ----------
        timeout
            Longest wait in seconds.

        Returns
        -------
        tuple or None
            Images, when they were complete, and samples since the frame before (n, 7); None if no
            frame came in that time, or the inlet was closed.
        """
        end = time.monotonic() + timeout
        with self.changed:
            while not self._closed:
                now = time.monotonic()
                if self._waiting and (ready := self._ready_at()) <= now:
                    parts, complete = self._waiting.popleft()
                    at = self._time_of(parts)
                    return parts, complete, self.imu_queue.take(at) if self.has_imu else None
                if now >= end:
                    return None
                self.changed.wait(min(end, ready if self._waiting else end) - now)
        return None

    def restart(self) -> None:
        """Forget halves of frames, and expect another clock: the device is started again."""
        with self.changed:
            self.fault_text = None
            self.other_size_since = None
            self.pairing.clear()
            self._clock.restart()
            self.rate.restart()

    def close(self) -> None:
        """Take nothing any more."""
        with self.changed:
            self._closed = True
            self.changed.notify_all()

    def counts(self) -> dict[str, float]:
        """Numbers for the report of a run."""
        with self.changed:
            counts: dict[str, float] = {
                "frames": self.n_frames,
                "frames_dropped": self.n_dropped,
                "frames_apart": self.pairing.n_apart,
                "images_alone": sum(self.pairing.n_alone.values()),
                "images_late": sum(self._clock.n_late.get(name, 0) for name in self._images),
                "images_of_other_size": self.n_of_other_size,
                "images_broken": self.n_broken,
            }
            if len(self._images) > 1:
                counts["worst_skew_ms"] = round(self.pairing.worst * 1e3, 3)
            counts["clock_jumps"] = self._clock.n_jumps
            counts["slow_periods"] = self.rate.n_low
            if self.has_imu:
                queue = self.imu_queue
                counts["imu_samples"] = queue.n
                counts["imu_samples_left_out"] = self.n_imu_left_out + self._join.n_without_accel
                counts["imu_gaps"] = queue.n_gaps
                counts["imu_longest_step_ms"] = round(queue.longest_step * 1e3, 3)
            return counts

    # ---- with the lock held ----------------------------------------------------------------------
    def _time_of(self, parts: Parts) -> float:
        return parts[self._images[0]].time

    def _ready_at(self) -> float:
        """When the first frame may be taken, on the clock of ``time.monotonic()``."""
        parts, complete = self._waiting[0]
        if not self.has_imu or self.imu_queue.newest >= self._time_of(parts):
            return 0.0
        return complete + _IMU_WAIT

    def _add_frame(self, parts: Parts, now: float) -> None:
        self.n_frames += 1
        self.last_frame = now
        self.other_size_since = None
        changed = self.rate.add(now)
        if changed is not None:
            self._reports.event(changed)
        if self.tap is not None:
            self.tap(parts, None)
        self._waiting.append((parts, now))
        while len(self._waiting) > self._room:
            self._waiting.popleft()
            self.n_dropped += 1
        self.changed.notify_all()

    def _add_imu(self, rows: FloatArray) -> None:
        if not len(rows):
            return
        if self.tap is not None:
            self.tap(None, rows)
        n_gaps = self.imu_queue.n_gaps
        self.imu_queue.add(rows)
        if self.imu_queue.n_gaps > n_gaps:
            longest = self.imu_queue.longest_step
            self._reports.warn("gap", f"left out samples of the IMU: {longest * 1e3:.0f} ms")
        self.changed.notify_all()

    def _timed(self, stream: str, samples: FloatArray, width: int) -> FloatArray:
        """Give samples times that grow; those that are late or not finite are left out."""
        rows = np.array(samples, np.float64).reshape(-1, width)
        finite = np.isfinite(rows).all(axis=1)
        good = rows[finite]
        if len(good):
            good[:, 0] = self._clock.times_of(stream, good[:, 0], time.monotonic())
            good = good[np.isfinite(good[:, 0])]
        if len(good) < len(rows):
            self.n_imu_left_out += len(rows) - len(good)
            self._reports.warn(
                "imu", "sent samples of the IMU that are late or not finite; they are left out"
            )
        return good

    def _has_usual_size(self, stream: str, array: NDArray[Any], now: float) -> bool:
        usual = self._shapes.setdefault(stream, array.shape[:2])
        if array.shape[:2] == usual:
            return True
        self.n_of_other_size += 1
        if self.other_size_since is None:
            self.other_size_since = now
        (height, width), (rows, columns) = usual, array.shape[:2]
        self._reports.warn(
            "size",
            f"sends {stream} images of {columns} x {rows} pixels, and sent {width} x {height} "
            "before; they are left out until the size is the same again",
        )
        return False
