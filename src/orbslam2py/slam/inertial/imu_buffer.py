# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU that wait for their images."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import EqualByValue, FloatArray
from orbslam2py.inertial.samples import clean_rows, imu_rows

_log = logging.getLogger(__name__)

#: Seconds without a sample that the motion of a camera by hand can be interpolated over: the same
#: as ``max_gap`` of the preintegration (`src/cpp/inertial/preintegration.hpp`).
MAX_GAP = 0.05
#: Seconds between times that are the same but for rounding.
_SAME = 1e-6
#: Samples that may wait: ten minutes at 2 kHz. Older ones are left out then.
_MOST = 1_200_000
#: Seconds between images and all samples, beyond which the clocks are different ones.
_FAR = 10.0
#: Seconds of images without any sample, after which a warning says so.
_PATIENCE = 1.0
_REPEATED = "samples of the IMU repeat the time of another one; the first of each is kept"
_UNSORTED = "samples of the IMU come out of order in time; they are sorted"


@dataclass(frozen=True, eq=False)
class ImuInterval(EqualByValue):
    """Samples that cover the time from one image to the next.

    Attributes
    ----------
    begin, end
        Time stamps of the two images [s].
    samples
        Rows ``[t, gx, gy, gz, ax, ay, az]``, float64 (n, 7), in s on the clock of the images, rad/s
        and m/s^2. The first row is at `begin` and the last one at `end`: readings there are
        interpolated between their neighbours, or repeat the nearest one where there is none
        beyond. (0, 7) if there are no samples near the interval.
    longest_gap
        Longest time without a reading that overlaps the interval [s].
    """

    begin: float
    end: float
    samples: FloatArray
    longest_gap: float

    @property
    def is_complete(self) -> bool:
        """Whether no gap is longer than 0.05 s."""
        return self.longest_gap <= MAX_GAP


class ImuBuffer:
    """Keeps samples until the image comes that they belong to.

    Samples may come at any time, in any portions and from any thread; those that cannot be used are
    left out, and one warning says so for each kind of fault. Nothing here waits but `wait_for`.

    Parameters
    ----------
    time_offset
        Seconds to add to the time of an image for the time on the clock of the IMU.

    Attributes
    ----------
    n_samples
        Samples that came so far, also those that were left out.
    """

    def __init__(self, time_offset: float = 0.0) -> None:
        self.time_offset = float(time_offset)
        # Guards all fields below; notified when samples come.
        self._changed = threading.Condition()
        self._rows: FloatArray = np.zeros((0, 7))
        self._new: list[FloatArray] = []
        self._newest = -np.inf
        self._step = 0.0
        self._in_time = True
        self._before: float | None = None
        self._image_at_last_sample: float | None = None
        self.n_samples = 0
        self._told: set[str] = set()

    @property
    def warnings(self) -> set[str]:
        """Kinds of faults that a warning was logged for."""
        with self._changed:
            return set(self._told)

    def add(self, samples: object) -> None:
        """Add samples, in any order.

        Parameters
        ----------
        samples
            `orbslam2py.datasets.ImuSamples` or rows ``[t, gx, gy, gz, ax, ay, az]``, float64
            (n, 7): s on the clock of the IMU, rad/s, m/s^2.

        Raises
        ------
        DatasetError
            If they have another shape or hold no numbers; nothing has changed then.
        """
        rows = imu_rows(samples)
        if not len(rows):
            return
        cleaned = clean_rows(rows)
        with self._changed:
            self.n_samples += len(rows)
            self._tell(cleaned.n_not_finite, "samples of the IMU are not finite; they are left out")
            self._tell(cleaned.n_unsorted, _UNSORTED)
            self._tell(cleaned.n_repeated, _REPEATED)
            if len(cleaned.rows):
                self._new.append(cleaned.rows.copy())
                self._newest = max(self._newest, float(cleaned.rows[-1, 0]))
                if len(cleaned.rows) > 1:
                    self._step = min(MAX_GAP, float(np.median(np.diff(cleaned.rows[:, 0]))))
            self._changed.notify_all()

    def wait_for(self, timestamp: float, timeout: float) -> bool:
        """Wait until the samples reach an image; only for streams.

        Samples that end less than one usual step before the image are enough. When they did not
        come in time, the following images do not wait, until samples come in time again.

        Parameters
        ----------
        timestamp
            Of the image [s].
        timeout
            Seconds to wait at most.

        Returns
        -------
        bool
            False if they did not come in that time; a warning says so once.
        """
        until = time.monotonic() + timeout
        with self._changed:
            wanted = timestamp + self.time_offset
            while self._newest + self._step < wanted:
                left = until - time.monotonic() if self._in_time else 0.0
                if left <= 0:
                    self._in_time = False
                    self._tell(
                        True,
                        f"the samples of the IMU did not come within {timeout:g} s after their "
                        "image; images are tracked without waiting longer",
                        kind="wait",
                    )
                    return False
                self._changed.wait(left)
            self._in_time = True
        return True

    def take(self, timestamp: float) -> ImuInterval | None:
        """Take the samples from the image before to this one.

        Parameters
        ----------
        timestamp
            Of this image [s]; must grow.

        Returns
        -------
        ImuInterval or None
            None for the first image.
        """
        with self._changed:
            self._sort_in()
            before, self._before = self._before, timestamp
            if self._image_at_last_sample is None:
                self._image_at_last_sample = timestamp
            interval = None if before is None else self._interval(before, timestamp)
            self._judge(interval, timestamp)
            at = timestamp + self.time_offset
            first = int(np.searchsorted(self._rows[:, 0], at, side="right")) - 1
            self._rows = self._rows[max(0, first) :]
        return interval

    def restart(self) -> None:
        """Forget the image before; samples that wait stay."""
        with self._changed:
            self._before = None
            self._image_at_last_sample = None

    # ---- inside; the lock is held ----------------------------------------------------------------
    def _sort_in(self) -> None:
        """Put the new samples among those that wait."""
        if not self._new:
            return
        new, self._new = self._new, []
        if self._before is not None:
            begin = self._before + self.time_offset
            late = sum(int((one[:, 0] < begin - MAX_GAP).sum()) for one in new)
            self._tell(
                late,
                "samples of the IMU came after the image that they belong to; they are left out; "
                "give samples before their image, or with it",
            )
        cleaned = clean_rows(np.concatenate([self._rows, *new]))
        self._tell(cleaned.n_repeated, _REPEATED)
        self._tell(cleaned.n_unsorted, _UNSORTED)
        rows = cleaned.rows
        if self._before is not None:
            begin = int(np.searchsorted(rows[:, 0], self._before + self.time_offset, "right")) - 1
            rows = rows[max(0, begin) :]
        if len(rows) > _MOST:
            self._tell(
                len(rows) - _MOST,
                "samples of the IMU wait for images that do not come; the oldest are left out",
            )
            rows = rows[-_MOST:]
        self._rows = rows

    def _interval(self, begin: float, end: float) -> ImuInterval:
        rows = self._rows
        t = rows[:, 0] - self.time_offset
        first = int(np.searchsorted(t, begin + _SAME, side="right"))  # after the begin
        last = int(np.searchsorted(t, end - _SAME, side="left"))  # not before the end
        # One reading on each side, if there is one.
        around = t[max(0, first - 1) : last + 1]
        if not len(around) or around[0] >= end or around[-1] <= begin - MAX_GAP:
            return ImuInterval(begin, end, np.zeros((0, 7)), end - begin)
        inside = rows[first:last].copy()
        inside[:, 0] = t[first:last]
        ends = np.empty((2, 7))
        for row, at in zip(ends, (begin, end), strict=True):
            row[0] = at
            row[1:] = [np.interp(at, t, rows[:, k]) for k in range(1, 7)]
        # Where no reading lies beyond an end, the time to the nearest one counts.
        edges = np.concatenate([[min(begin, around[0])], around, [max(end, around[-1])]])
        return ImuInterval(
            begin,
            end,
            np.concatenate([ends[:1], inside, ends[1:]]),
            float(np.diff(edges).max()),
        )

    def _judge(self, interval: ImuInterval | None, timestamp: float) -> None:
        """Warn of missing samples."""
        rows, at = self._rows, timestamp + self.time_offset
        if self._newest == -np.inf:
            assert self._image_at_last_sample is not None
            self._tell(
                timestamp - self._image_at_last_sample > _PATIENCE,
                f"no samples of the IMU came with the images of the first {_PATIENCE:g} s; give "
                "them to track(..., imu=samples) or add_imu(samples)",
            )
            return
        if len(rows) and (rows[0, 0] > at + _FAR or rows[-1, 0] < at - _FAR):
            self._tell(
                True,
                f"the samples of the IMU are of {rows[0, 0]:.6g} s to {rows[-1, 0]:.6g} s, but the "
                f"image is of {timestamp:.6g} s; give both in seconds on one clock, or their "
                "difference as time offset in the IMU settings",
                kind="clock",
            )
        elif interval is not None and not interval.is_complete:
            self._tell(
                True,
                f"the samples of the IMU have a gap of {interval.longest_gap:.3f} s before the "
                f"image of {timestamp:.6f} s (more than {MAX_GAP:g} s); motion in gaps is unknown",
                kind="gap",
            )

    def _tell(self, count: int | bool, text: str, kind: str | None = None) -> None:
        """Log a warning, once for each kind."""
        kind = kind or text
        if not count or kind in self._told:
            return
        self._told.add(kind)
        _log.warning("%s", text if isinstance(count, bool) else f"{count} {text}")
