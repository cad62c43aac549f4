# SPDX-License-Identifier: BSD-3-Clause
"""The figures at the end of a run, as a person reads them."""

from __future__ import annotations

from typing import Any

import pytest
from rich.console import Console

from orbslam2py.cli.display import report_table
from orbslam2py.runs.losses import losses_report
from support.made_up_rows import rows_of

pytestmark = pytest.mark.watchdog(20)


def printed(letters: str, **more: Any) -> str:
    report = {"sequence": "lap", "sensor": "rgbd", "milliseconds": {}}
    console = Console(width=120)
    with console.capture() as capture:
        console.print(report_table(report | losses_report(rows_of(letters)) | more))
    return capture.get()


def line_with(text: str, table: str) -> str:
    (line,) = [line for line in table.splitlines() if text in line]
    return " ".join(line.strip("│ ").split())


def test_never_lost() -> None:
    assert line_with("lost", printed("kkk")) == "lost │ never"


def test_losses_are_one_line_and_one_for_every_reason() -> None:
    table = printed("kkkrlllkkilkkrl")
    lines = [" ".join(line.strip("│ ").split()) for line in table.splitlines() if "lost" in line]
    assert lines == [
        "lost │ 3 times, 8 frames, 0.7 s in all, 0.4 s at the longest",
        "lost at end │ yes",
        "lost: not found in the map │ 5",
        "lost: too few matches with the reference keyframe │ 2",
        "lost: too few inliers in the local map │ 1",
    ]


@pytest.mark.parametrize(("sensor", "unit"), [("rgbd", "m"), ("mono", "units")])
def test_loops_are_in_the_unit_of_the_map(sensor: str, unit: str) -> None:
    loop = {"keyframes": [3, 40], "correction_m": 0.5, "correction_deg": 1.0, "scale": 1.0}
    line = line_with("loop", printed("k", sensor=sensor, loops=[loop]))
    assert line == f"loop │ keyframe 40 at 3: 0.500 {unit}, 1.00 deg"


def test_once() -> None:
    line = line_with("in all", printed("kkrlk"))
    assert line == "lost │ once, 2 frames, 0.2 s in all, 0.2 s at the longest"
