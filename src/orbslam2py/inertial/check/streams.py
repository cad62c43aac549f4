# SPDX-License-Identifier: BSD-3-Clause
"""Faults that the samples of an IMU show without a camera: dead and saturated axes, units."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray

_AXES = "xyz"
GRAVITY = 9.81  # m/s^2
#: Length of the specific force [m/s^2] that is gravity by its size, also in motion.
_NEAR_GRAVITY = (7.0, 13.0)
#: Readings are averaged over so many seconds.
_SPAN = 0.5
#: Samples without any change, from which on an axis is dead.
_DEAD = 20
#: Samples in a row at the largest value, from which on it may be the end of the range.
_FLAT = 4
#: Change [share of what the axis covers] before such a row, which a smooth peak does not have.
_STEEP = 3e-3


def usual_length(t: FloatArray, readings: FloatArray) -> float:
    """Return the median length of means over half a second of readings (n, 3) at seconds (n,).

    Shaking has a mean near zero: the mean specific force is gravity.
    """
    if len(t) < 2:
        return float(np.median(np.linalg.norm(readings, axis=1)))
    steps = 0.5 * np.diff(t)[:, None] * (readings[1:] + readings[:-1])
    integral = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    span = min(_SPAN, float(t[-1] - t[0]))
    begin = t[t <= t[-1] - span + 1e-9]
    first, last = (
        np.column_stack([np.interp(at, t, one) for one in integral.T])
        for at in (begin, begin + span)
    )
    return float(np.median(np.linalg.norm(last - first, axis=1))) / span


def swapped(t: FloatArray, gyro: FloatArray, accel: FloatArray) -> bool:
    """Whether the readings (n, 3) of the gyro are those of the accelerometer and the reverse."""
    low, high = _NEAR_GRAVITY
    g, a = usual_length(t, gyro), usual_length(t, accel)
    steady = _steadiness(accel) > _steadiness(gyro)
    # Beside a gyro that turns with 10 degrees/s, gravity of 1 g is there, steadier than the gyro.
    return low < g < high and a < 5 and not (0.7 < a < 1.3 and steady)


def _steadiness(readings: FloatArray) -> float:
    """Length of the mean of readings (n, 3) by their usual length, 0 to 1."""
    usual = float(np.sqrt((readings**2).sum(axis=1).mean()))
    return float(np.linalg.norm(readings.mean(axis=0))) / max(usual, 1e-9)


def dead_axes(readings: FloatArray) -> list[str]:
    """Names of the axes of readings (n, 3) that never change."""
    if len(readings) < _DEAD:
        return []
    return [name for name, axis in zip(_AXES, readings.T, strict=True) if np.ptp(axis) == 0]


def saturated(axis: FloatArray) -> FloatArray:
    """Find the samples of an axis (n,) that lie at the end of its range, bool (n,).

    There the reading is the largest one for many samples in a row, and is reached with a step. How
    long a row must be depends on how often neighbours are equal elsewhere, as they are in coarse
    readings at rest.
    """
    found = np.zeros(len(axis), dtype=bool)
    for sign in (1.0, -1.0):
        values = sign * axis
        top = float(values.max(initial=0.0))
        if top <= 0:
            continue
        at_top = values >= top * (1 - 1e-6)
        equal = (np.diff(values) == 0)[~at_top[1:]]
        share = min(0.95, (equal.sum() + 1) / (len(equal) + 2))
        least = max(_FLAT, 2 + int(np.log(1e3 * len(axis)) / -np.log(share)))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], at_top, [False]]).astype(int)))
        for begin, end in edges.reshape(-1, 2):
            around = [values[k] for k in (begin - 1, end) if 0 <= k < len(values)]
            if end - begin >= least and around and top - min(around) > _STEEP * float(np.ptp(axis)):
                found |= at_top
    return np.asarray(found)


def accel_unit(length: float) -> str:
    """Determine the unit of an accelerometer from its `usual_length`: ``m/s^2``, ``g`` or empty."""
    if _NEAR_GRAVITY[0] < length < _NEAR_GRAVITY[1]:
        return "m/s^2"
    return "g" if _NEAR_GRAVITY[0] < length * GRAVITY < _NEAR_GRAVITY[1] else ""
