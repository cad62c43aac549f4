# SPDX-License-Identifier: BSD-3-Clause
"""What is shown while a sequence is tracked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest
from rich.progress import Progress, TextColumn

from orbslam2py import Reason, System, TrackingRecord, TrackingState
from orbslam2py.cli.display import Display
from orbslam2py.runs import FrameRow

pytestmark = pytest.mark.watchdog(20)


def test_progress_tells_why_there_is_no_pose() -> None:
    record = TrackingRecord(
        *(0, 0.0, 0, TrackingState.NOT_INITIALIZED, Reason.LOW_PARALLAX),
        *(None, None, 0, 0, False, -1),
    )
    status = []
    for reason in (str(record.reason), ""):
        bar = Progress(TextColumn("{task.fields[status]}"), get_time=lambda: 1.0)
        row = FrameRow(0, "0.0", record, reason)
        Display(bar, 10).show(row, cast(System, SimpleNamespace(n_keyframes=0, n_map_points=0)))
        status.append(bar.tasks[0].fields["status"])
    assert "NOT_INITIALIZED" in status[0]
    assert "(low parallax between the two views)" in status[0]
    assert "(" not in status[1]
