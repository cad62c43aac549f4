# SPDX-License-Identifier: BSD-3-Clause
"""What the page of a run says of maps that became one."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from orbslam2py.runs.report_page import write_report_page
from orbslam2py.runs.report_page.run_folder import read_run
from orbslam2py.runs.report_page.story import Event, Story
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.page

#: Map 0, lost, map 1, which is found to be part of map 0.
STATES = "k" * 12 + "lll" + "k" * 25
MAPS = "0" * 15 + "1" * 15 + "0" * 10
MERGED_AT = 28


def with_merges(run: Path, *, at: int = MERGED_AT, scale: float = 1.0) -> Path:
    times = read_run(run).frames.timestamps
    entry = {
        "map": 0,
        "merged": 1,
        "keyframes": [2, 9],
        "timestamps": [float(times[10]), float(times[at])],
        "scale": scale,
    }
    file = run / "report.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"merges": [entry]}))
    write_report_page(run / "report.html", run)
    return run


def events_of(run: Path) -> list[Event]:
    return Story.of(read_run(run)).events


def test_a_merge_is_told_and_no_return(tmp_path: Path) -> None:
    run = with_merges(made_up_run(tmp_path / "r", STATES, maps=MAPS, loop=False))
    told = [(event.position, event.kind, event.text) for event in events_of(run)]
    assert told[1:] == [
        (15, "map", "map 1 begun"),
        (28, "merge", "map 1 became part of map 0: keyframe 9 shows the place of keyframe 2"),
    ]
    page = (run / "report.html").read_text()
    assert "map 0 again" not in page
    assert "</i>maps became one" in page
    strip = page.partition('id="plot-states"')[2].partition("</figure>")[0]
    assert strip.count('class="mark m-merge"') == 1
    assert strip.count('class="mark m-map"') == 1
    inliers = page.partition('id="plot-inliers"')[2].partition("</figure>")[0]
    assert "m-merge" in inliers, "the map was moved, as by a loop"


def test_a_merge_of_one_camera_tells_the_scale(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", STATES, maps=MAPS, loop=False, sensor="mono")
    texts = [event.text for event in events_of(with_merges(run, scale=0.8123))]
    assert texts[-1].endswith("shows the place of keyframe 2; its lengths times 0.8123")


def test_a_return_before_the_merge_is_one(tmp_path: Path) -> None:
    """The camera was found in the other map, and only then did they become one."""
    run = with_merges(made_up_run(tmp_path / "r", STATES, maps=MAPS, loop=False), at=35)
    told = [(event.position, event.kind) for event in events_of(run)]
    assert told[1:] == [(15, "map"), (30, "map"), (35, "merge")]
    page = (run / "report.html").read_text()
    assert "map 0 again" in page
    assert "</i>new map" not in page, "coming back is none"
    assert "</i>another map" in page


def test_maps_that_became_one_on_the_way(tmp_path: Path) -> None:
    """2 became part of 1, and that of 0: the camera in 2 is in 0 then."""
    states, maps = "k" * 30, "0" * 8 + "1" * 6 + "2" * 8 + "0" * 8
    run = made_up_run(tmp_path / "r", states, maps=maps, loop=False)
    times = read_run(run).frames.timestamps.tolist()
    entries: list[dict[str, Any]] = [
        {"map": a, "merged": b, "keyframes": [1, 2], "timestamps": [0.0, times[at]], "scale": 1.0}
        for a, b, at in ((1, 2, 19), (0, 1, 21))
    ]
    file = run / "report.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"merges": entries}))
    kinds = [(event.position, event.kind) for event in events_of(run)]
    assert kinds == [(8, "map"), (14, "map"), (19, "merge"), (21, "merge")]


@pytest.mark.parametrize("n", [0, 2])
def test_merges_are_among_all_figures(tmp_path: Path, n: int) -> None:
    run = made_up_run(tmp_path / "r")
    file = run / "report.json"
    entry = {
        "map": 0, "merged": 1, "keyframes": [0, 1], "timestamps": [0.0, 0.1], "scale": 1.0,
    }  # fmt: skip
    file.write_text(json.dumps(json.loads(file.read_text()) | {"merges": [entry] * n}))
    write_report_page(run / "report.html", run)
    figures = (run / "report.html").read_text().partition('id="figures"')[2]
    (value,) = re.findall(r"<b>maps joined</b></td><td>(\d+)", figures)
    assert value == str(n)
