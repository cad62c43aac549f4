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


def test_one_frame_is_one() -> None:
    assert "once, 1 frame, 0.1 s in all" in line_with("in all", printed("kkrk"))


def test_errors_are_told_with_the_frames_that_they_are_of() -> None:
    """After a new map the errors are of the last one: 2 poses of a run of 10 frames."""
    figures = {"frames": 10, "tracked": 9, "matched_poses": 2, "matched_of_poses": 2}
    lengths = {"matched_path_m": 0.123, "true_path_m": 1.5, "ate_rmse_m": 0.00254}
    lengths |= {"tracked_fraction": 0.9, "ate_alignment": "se3"}
    table = printed("k", **figures, **lengths)
    told = "0.0025 m over 2 of 10 frames, the main map only; turned and shifted"
    assert line_with("ATE", table) == f"error (ATE, RMSE) │ {told}"
    assert line_with("tracked", table) == "tracked │ 9 of 10 frames (90.0 %)"
    assert line_with("path", table) == "true path compared │ 0.12 of 1.50 m"
    whole = printed("k", **figures | {"tracked": 2}, **lengths)
    assert "0.0025 m over 2 of 10 frames; turned" in line_with("ATE", whole)


def test_a_loaded_map_is_told_in_words() -> None:
    loaded = {"file": "office.orbmap", "keyframes": 12, "map_points": 3000, "runs": 1}
    table = printed("k", loaded_map=loaded, relocalisations=1)
    line = line_with("office", table)
    assert line == "loaded map │ office.orbmap: 12 keyframes, 3000 map points, 1 run"
    line = line_with("relocalisations", table)
    assert line == "relocalisations │ 1, the first finding in the loaded map"
    assert line_with("relocalisations", printed("k", relocalisations=2)) == "relocalisations │ 2"
    assert "relocalisations" not in printed("k", relocalisations=0)


def test_times_have_their_unit() -> None:
    times = {"median": 1.0, "mean": 1.5, "p99": 2.0}
    table = printed("k", milliseconds={"track": times, "mapping": times, "loop.detect": times})
    assert line_with("image", table) == "tracking an image │ median 1.0 ms, p99 2.0 ms"
    assert line_with("keyframe", table) == "mapping a keyframe │ median 1.0 ms, p99 2.0 ms"
    assert "loop.detect" not in table


@pytest.mark.parametrize("key", ["skipped_frames", "dropped_frames", "weak_frames", "resets"])
def test_what_did_not_happen_is_not_told(key: str) -> None:
    assert printed("k", **{key: 0}) == printed("k")
    assert printed("k", **{key: 3}).count("│ 3 ") == 1
