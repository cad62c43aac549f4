# SPDX-License-Identifier: BSD-3-Clause
"""Converts stamps of a device into growing times, for any behaviour of its clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray

#: A stamp that lies further than this in the future is a jump of the clock, seconds.
JUMP = 1.0
#: A stamp that lies further back than this is a jump of the clock, not a late delivery, seconds.
_BACK = 0.5
#: Stamps in a row that do not grow, after which the clock is taken as set back.
_MOST_LATE = 5
#: Larger stamps are seconds since 1970 and are kept as they are (the year 2001).
_SINCE_1970 = 1e9
#: Times grow by at least this much over a jump, seconds.
_LEAST_STEP = 1e-3


@dataclass
class _Stream:
    """The last stamp of a stream, and its converted time."""

    stamp: float
    time: float
    arrival: float
    epoch: int
    n_late: int = 0
    restarted: bool = False


class DeviceClock:
    """Maps the stamps of all streams of a device to seconds since 1970 that grow in each stream.

    The clock of the device counts, shifted to the clock of this computer unless it gives seconds
    since 1970 itself. When it jumps, back or more than `JUMP` ahead, the shift changes so that
    times continue by the clock of this computer. All streams share the shifts: images that belong
    together stay together.

    Parameters
    ----------
    report
        Called with the end of a sentence for each jump.
    wall_clock
        Seconds since 1970 at the beginning.
    monotonic
        The clock of arrival times at the beginning, seconds.
    """

    def __init__(
        self,
        report: Callable[[str], None],
        wall_clock: Callable[[], float] = time.time,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._report = report
        self._wall_minus_monotonic = wall_clock() - monotonic()
        #: Shift of each epoch, seconds; a new one begins with each jump.
        self._shifts: list[float] = []
        #: Largest lead of stamps over arrivals in the present epoch, seconds.
        self._lead = -np.inf
        self._streams: dict[str, _Stream] = {}
        self.n_jumps = 0
        #: Deliveries by stream that were refused because their stamp did not grow.
        self.n_late: dict[str, int] = {}

    def restart(self) -> None:
        """Expect that the clock of the device starts again: it was started again."""
        self._lead = -np.inf
        for stream in self._streams.values():
            stream.restarted = True

    def time_of(self, name: str, stamp: float, arrival: float) -> float | None:
        """Map the stamp of a delivery.

        Parameters
        ----------
        name
            The stream.
        stamp
            On the clock of the device, seconds.
        arrival
            On the clock of ``time.monotonic()``, seconds.

        Returns
        -------
        float or None
            Seconds since 1970, more than all before of the stream; None if the delivery comes after
            a later one and must be left out.
        """
        last = self._streams.get(name)
        if last is None:
            if not self._shifts:
                host = arrival + self._wall_minus_monotonic
                self._shifts.append(0.0 if stamp > _SINCE_1970 else host - stamp)
            last = _Stream(stamp, -np.inf, arrival, len(self._shifts) - 1)
            self._streams[name] = last
            return self._accept(last, stamp, arrival)
        if last.restarted:
            last.restarted = False
            expected = last.time + arrival - last.arrival
            at = stamp + self._shifts[last.epoch]
            if at <= last.time or abs(at - expected) > JUMP:
                self._bridge(last, stamp, arrival, is_fault=False)
        elif stamp <= last.stamp:
            last.n_late += 1
            if stamp > last.stamp - _BACK and last.n_late < _MOST_LATE:
                self.n_late[name] = self.n_late.get(name, 0) + 1
                return None
            self._bridge(last, stamp, arrival)
        elif self._lead_of(last, stamp, arrival) > self._lead + JUMP:
            self._bridge(last, stamp, arrival)
        return self._accept(last, stamp, arrival)

    def times_of(self, name: str, stamps: FloatArray, arrival: float) -> FloatArray:
        """Map the stamps (n,) of samples that came together; NaN for those to be left out."""
        last = self._streams.get(name)
        growing = bool((np.diff(stamps) > 0).all())
        if last is not None and growing and not last.restarted and stamps[0] > last.stamp:
            end = float(stamps[-1])
            if self._lead_of(last, end, arrival) <= self._lead + JUMP:
                self._accept(last, end, arrival)
                return np.asarray(stamps + self._shifts[last.epoch], np.float64)
        times = [self.time_of(name, float(stamp), arrival) for stamp in stamps]
        return np.array([np.nan if one is None else one for one in times], np.float64)

    def _lead_of(self, last: _Stream, stamp: float, arrival: float) -> float:
        return stamp + self._shifts[last.epoch] - arrival

    def _accept(self, last: _Stream, stamp: float, arrival: float) -> float:
        last.stamp, last.arrival, last.n_late = stamp, arrival, 0
        last.time = stamp + self._shifts[last.epoch]
        if last.epoch == len(self._shifts) - 1:
            self._lead = max(self._lead, self._lead_of(last, stamp, arrival))
        return last.time

    def _bridge(
        self, last: _Stream, stamp: float, arrival: float, *, is_fault: bool = True
    ) -> None:
        """Follow another stream over a jump, or be the first one."""
        expected = max(last.time + arrival - last.arrival, last.time + _LEAST_STEP)
        at = stamp + self._shifts[-1]
        is_first = last.epoch == len(self._shifts) - 1 or abs(at - expected) > JUMP
        if not is_first and at > last.time:
            last.epoch = len(self._shifts) - 1
            return
        if is_fault:
            self.n_jumps += 1
            jump = stamp + self._shifts[last.epoch] - expected
            direction = "ahead" if jump > 0 else "back"
            self._report(
                f"has a clock that jumped {direction} by {abs(jump):.3g} s; the times continue "
                "without the jump"
            )
        self._shifts.append(expected - stamp)
        last.epoch = len(self._shifts) - 1
        self._lead = -np.inf
