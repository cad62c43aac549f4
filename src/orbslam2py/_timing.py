# SPDX-License-Identifier: BSD-3-Clause
"""Wall-clock time per stage, for reports; never used for results."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from contextlib import AbstractContextManager

import numpy as np


class StageTimer:
    """Milliseconds per named stage of one unit of work."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        """Add the time of the block to `stage`."""
        return _Stage(self.milliseconds, stage)


class _Stage:
    """One timed block. A class, because generators cost several times as much in every frame."""

    __slots__ = ("_begin", "_milliseconds", "_stage")

    def __init__(self, milliseconds: dict[str, float], stage: str) -> None:
        self._milliseconds = milliseconds
        self._stage = stage

    def __enter__(self) -> None:
        self._begin = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        elapsed = 1e3 * (time.perf_counter() - self._begin)
        self._milliseconds[self._stage] = self._milliseconds.get(self._stage, 0.0) + elapsed


class StageStatistics:
    """Collects stage times of many units of work; may be used from several threads.

    A bounded sample is kept per stage (the latest `capacity` values), so that memory does not grow
    with the length of the run.
    """

    def __init__(self, capacity: int = 10_000) -> None:
        self._capacity = capacity
        self._values: dict[str, list[float]] = defaultdict(list)
        self._counts: dict[str, int] = defaultdict(int)
        self._lock = threading.Lock()

    def add(self, milliseconds: dict[str, float]) -> None:
        """Add the stages of one unit of work."""
        with self._lock:
            for stage, value in milliseconds.items():
                values = self._values[stage]
                if len(values) < self._capacity:
                    values.append(value)
                else:
                    values[self._counts[stage] % self._capacity] = value
                self._counts[stage] += 1

    def summary(self) -> dict[str, dict[str, float]]:
        """Median, mean and 99th percentile per stage in milliseconds, and the count."""
        with self._lock:
            return {
                stage: {
                    "median": round(float(np.median(values)), 4),
                    "mean": round(float(np.mean(values)), 4),
                    "p99": round(float(np.percentile(values, 99)), 4),
                    "count": self._counts[stage],
                }
                for stage, values in self._values.items()
                if values
            }
