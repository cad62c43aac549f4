# SPDX-License-Identifier: BSD-3-Clause
"""Assigns arriving samples of an IMU to frames."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray

#: A step between samples that is longer than this multiple of the usual one is a gap.
_GAP = 5.0


class ImuJoin:
    """Joins a gyro and an accelerometer: the latter is interpolated at the times of the gyro."""

    def __init__(self) -> None:
        self._gyro = np.zeros((0, 4))
        self._accel = np.zeros((0, 4))
        #: Samples of the gyro before the first one of the accelerometer.
        self.n_without_accel = 0

    def add_gyro(self, rows: FloatArray) -> FloatArray:
        """Take rows of time and rate (n, 4); return the samples (m, 7) that are complete."""
        self._gyro = np.vstack([self._gyro, rows])
        return self._joined()

    def add_accel(self, rows: FloatArray) -> FloatArray:
        """Take rows of time and specific force (n, 4); return the samples that are complete."""
        self._accel = np.vstack([self._accel, rows])
        return self._joined()

    def _joined(self) -> FloatArray:
        gyro, accel = self._gyro, self._accel
        if not len(gyro) or not len(accel):
            return np.zeros((0, 7))
        early = int(np.searchsorted(gyro[:, 0], accel[0, 0]))
        self.n_without_accel += early
        until = int(np.searchsorted(gyro[:, 0], accel[-1, 0], side="right"))
        ready, self._gyro = gyro[early:until], gyro[max(early, until) :]
        at = [np.interp(ready[:, 0], accel[:, 0], accel[:, k]) for k in (1, 2, 3)]
        # The last sample that is not later than the next one of the gyro is needed again.
        self._accel = accel[-1:]
        return np.column_stack([ready, *at])


class ImuQueue:
    """Samples that no frame has taken yet. None is ever dropped."""

    def __init__(self) -> None:
        self._rows: list[FloatArray] = []
        #: Time of the last sample, seconds since 1970.
        self.newest = -np.inf
        self.n = 0
        #: Longest step between two samples, seconds, and the number of gaps.
        self.longest_step = 0.0
        self.n_gaps = 0
        self._usual_step: float | None = None

    def add(self, rows: FloatArray) -> None:
        """Take samples (n, 7) in the order of time."""
        if not len(rows):
            return
        if self.n:
            self._note_steps(np.diff(rows[:, 0], prepend=self.newest))
        elif len(rows) > 1:
            self._note_steps(np.diff(rows[:, 0]))
        self.n += len(rows)
        self.newest = float(rows[-1, 0])
        self._rows.append(rows)

    def take(self, until: float) -> FloatArray:
        """Return and forget the samples (n, 7) whose time is not after `until`."""
        if not self._rows:
            return np.zeros((0, 7))
        rows = np.vstack(self._rows)
        end = int(np.searchsorted(rows[:, 0], until, side="right"))
        self._rows = [rows[end:]] if end < len(rows) else []
        return rows[:end]

    def _note_steps(self, steps: FloatArray) -> None:
        if self._usual_step is None:
            self._usual_step = float(np.median(steps))
            return
        self.longest_step = max(self.longest_step, float(steps.max()))
        self.n_gaps += int((steps > _GAP * self._usual_step).sum())
        # A running mean of the steps that are none of a gap.
        usual = steps[steps <= _GAP * self._usual_step]
        if len(usual):
            self._usual_step += 0.05 * (float(usual.mean()) - self._usual_step)
