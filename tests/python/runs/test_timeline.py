# SPDX-License-Identifier: BSD-3-Clause
"""Where a path has gaps, and what was tracked when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orbslam2py.runs.timeline import Timeline, gaps_in_time
from support.made_up_rows import rows_of

pytestmark = pytest.mark.watchdog(20)


def test_spans_without_a_pose() -> None:
    timeline = Timeline.of(rows_of("nnkkrlkkskl"), 0)
    assert timeline.untracked == [
        pytest.approx(span) for span in [(0.0, 0.2), (0.4, 0.6), (0.8, 0.9), (1.0, 1.1)]
    ]
    assert timeline.in_others == {}
    assert timeline.duration == pytest.approx(1.0)


def test_spans_in_an_earlier_map() -> None:
    timeline = Timeline.of(rows_of("kkkr"), 1)
    assert timeline.in_others == {0: [pytest.approx((0.0, 0.3))]}
    assert timeline.untracked == [pytest.approx((0.3, 0.4))]


def test_spans_are_told_by_map() -> None:
    rows = rows_of("kkrkkrkk")
    numbers = [0, 0, 0, 1, 1, 1, 0, 0]
    rows = [
        replace(row, record=replace(row.record, map_index=number))
        for row, number in zip(rows, numbers, strict=True)
    ]
    assert Timeline.of(rows, 1).in_others == {
        0: [pytest.approx((0.0, 0.2)), pytest.approx((0.6, 0.8))]
    }
    assert list(Timeline.of(rows, 2).in_others) == [0, 1]
    assert Timeline.of(rows, 0, {1: 0}).in_others == {}, "map 1 is part of map 0 at the end"


def test_gaps_of_the_path() -> None:
    rows = rows_of("kkrkkdkskdddddddddddk")
    positions = np.array([i for i, row in enumerate(rows) if row.state == "OK"])
    gaps = Timeline.of(rows, 0).gaps_before(positions)
    # After the loss, not across one dropped frame, after the skipped one, and after 1.2 s.
    assert positions[gaps].tolist() == [3, 8, 20]


def test_gaps_in_time() -> None:
    assert gaps_in_time(np.array([0.0, 0.1, 0.2, 0.3, 1.2, 2.3])).tolist() == [False] * 5 + [True]
    assert gaps_in_time(np.array([0.0, 2.0, 4.0, 6.0])).tolist() == [False] * 4, "two a second"
    assert gaps_in_time(np.zeros(0)).tolist() == []
    empty = Timeline.of([], 0)
    assert (empty.duration, empty.untracked) == (0.0, [])


def test_frames_that_were_skipped_may_go_backwards() -> None:
    nothing = np.zeros(3, np.int64)
    assert Timeline(np.array([0.0, 0.4, -0.1]), nothing, [], {}).duration == 0.4
    assert Timeline(np.array([0.0, -0.1, -0.2]), nothing, [], {}).duration == 0.0
    assert Timeline(np.zeros(0), nothing[:0], [], {}).duration == 0.0
