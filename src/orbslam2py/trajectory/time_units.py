# SPDX-License-Identifier: BSD-3-Clause
"""The unit of time in a file of another program."""

from __future__ import annotations

from enum import Enum

import numpy as np

from orbslam2py._arrays import FloatArray

#: Seconds since 1970 from the year 2000 to 2100.
_EPOCH = (9.4e8, 4.2e9)
#: Times as large as this are nanoseconds, whatever the step.
_NANOSECONDS = 1e17
_DAY = 86400.0
#: Steps between poses that a camera path has [s].
_SHORTEST_STEP, _LONGEST_STEP = 5e-4, 10.0
#: A path with longer steps may be one in another unit [s].
_SLOW = 2.0
#: Share of the time that two paths have in common, below which another unit is tried.
_LITTLE = 0.1


class TimeUnit(str, Enum):
    """Unit of the time stamps of a file."""

    SECONDS = "s"
    MILLISECONDS = "ms"
    MICROSECONDS = "us"
    NANOSECONDS = "ns"

    @property
    def per_second(self) -> int:
        """Number of them in a second."""
        return {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[self.value]

    def __str__(self) -> str:
        return self.value


#: Longest step [s] with which a time since 1970 in this unit is believed: a time in nanoseconds
#: since the computer was started can be as large, but its steps are then far longer.
_BELIEVED = {
    TimeUnit.SECONDS: _DAY,
    TimeUnit.MILLISECONDS: 1000.0,
    TimeUnit.MICROSECONDS: 3.0,
    TimeUnit.NANOSECONDS: np.inf,
}


def unit_by_digits(times: FloatArray, named: TimeUnit | None = None) -> TimeUnit:
    """Return the unit of times by their size and by the step between them.

    Parameters
    ----------
    times
        Times in the file, float64 (n,).
    named
        The unit in the header of the file. A time since 1970 takes precedence over it.

    Returns
    -------
    TimeUnit
        The unit; seconds in doubt.
    """
    largest = float(np.abs(times).max(initial=0.0))
    step = _usual_step(times)
    for unit, longest in _BELIEVED.items():
        since_1970 = _EPOCH[0] <= largest / unit.per_second <= _EPOCH[1]
        if since_1970 and step / unit.per_second <= longest:
            return unit
    if named is not None:
        return named
    if largest >= _NANOSECONDS:
        return TimeUnit.NANOSECONDS
    if step <= _DAY:
        return TimeUnit.SECONDS
    return TimeUnit.NANOSECONDS if step >= 1e6 else TimeUnit.MICROSECONDS


def unit_by_other(seconds: FloatArray, unit: TimeUnit, other: FloatArray) -> TimeUnit:
    """Return the unit of times by another trajectory of the same recording.

    Another unit is used only if the times are implausible as read: they do not overlap with the
    others, or their steps are too long for a trajectory and they overlap little.

    Parameters
    ----------
    seconds
        Times as read [s], float64 (n,).
    unit
        The unit as read.
    other
        Times of the other trajectory [s], float64 (m,).

    Returns
    -------
    TimeUnit
        `unit` itself if no other unit makes both overlap.
    """
    if not len(seconds) or not len(other):
        return unit
    common = _common_share(seconds, other)
    step = _usual_step(seconds)
    if common > 0 and (step < _SLOW or common >= _LITTLE):
        return unit
    shares = {}
    for candidate in TimeUnit:
        factor = unit.per_second / candidate.per_second
        plausible = not step or _SHORTEST_STEP <= step * factor <= _LONGEST_STEP
        if candidate is not unit and plausible:
            shares[candidate] = _common_share(seconds * factor, other)
    if not shares:
        return unit
    best = max(shares, key=lambda candidate: shares[candidate])
    return best if shares[best] > max(10 * common, 0.0) else unit


def _usual_step(times: FloatArray) -> float:
    steps = np.diff(np.sort(times))
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 0.0


def _common_share(first: FloatArray, second: FloatArray) -> float:
    """Return the length of the common time, relative to the shorter of both; 0 to 1."""
    begin, end = max(first.min(), second.min()), min(first.max(), second.max())
    whole = max(first.max(), second.max()) - min(first.min(), second.min())
    if end < begin:
        return 0.0
    return float((end - begin) / whole) if whole > 0 else 1.0
