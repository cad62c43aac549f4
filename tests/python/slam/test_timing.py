# SPDX-License-Identifier: BSD-3-Clause
"""Times of stages."""

from __future__ import annotations

import time

import pytest

from orbslam2py._timing import StageStatistics, StageTimer

pytestmark = pytest.mark.watchdog(20)


def test_timer_adds_up_and_counts_failing_blocks() -> None:
    timer = StageTimer()
    for _ in range(2):
        with timer("a"):
            time.sleep(0.002)
    with pytest.raises(KeyError), timer("b"):
        raise KeyError
    assert timer.milliseconds["a"] >= 4.0
    assert timer.milliseconds["b"] >= 0.0


def test_statistics() -> None:
    statistics = StageStatistics()
    for value in range(1, 102):
        statistics.add({"a": float(value)})
    statistics.add({"b": 2.0})
    summary = statistics.summary()
    expected = {"median": 51.0, "mean": 51.0, "p99": 100.0, "count": 101}
    assert expected.items() <= summary["a"].items()
    assert summary["b"]["median"] == 2.0
    assert StageStatistics().summary() == {}


def test_statistics_hold_the_latest_values_of_a_long_run() -> None:
    statistics = StageStatistics(capacity=10)
    for value in range(100):
        statistics.add({"a": float(value)})
    assert statistics.summary()["a"]["mean"] == pytest.approx(94.5)
    assert statistics.summary()["a"]["count"] == 100
