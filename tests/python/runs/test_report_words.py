# SPDX-License-Identifier: BSD-3-Clause
"""What the page of a run says first, and what it leaves out where there is nothing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from orbslam2py.runs.report_page import write_report_page
from orbslam2py.runs.report_page.explained import STAGES_BESIDE
from support.documents import ROOT
from support.made_up_runs import made_up_run

pytestmark = [pytest.mark.watchdog(60), pytest.mark.page]


def changed(run: Path, **more: object) -> str:
    """The page of a run with other entries in its report.json."""
    file = run / "report.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | more))
    write_report_page(run / "report.html", run)
    return (run / "report.html").read_text().partition("<main>")[2].partition("</main>")[0]


def test_warnings_stand_before_everything_else(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r")
    assert 'role="alert"' not in changed(run)
    page = changed(run, warnings=["the calibration <fits> badly", "depth images do not fit"])
    banner, _, rest = page.partition('class="tiles"')
    assert "2 warnings" in banner
    assert "The calibration &lt;fits&gt; badly" in banner
    assert "Depth images do not fit" in banner
    assert "Depth images do not fit" not in rest


def test_what_ended_the_run_stands_first(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r")
    page = changed(run, error="no <image>", seen_frames=40, frames=60, warnings=["it is dark"])
    assert page.index("The run failed after 40 of 60 frames: no &lt;image&gt;") < page.index("dark")


def test_a_warning_is_the_likely_cause_of_an_empty_run(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", "n" * 12)
    assert "most likely" not in changed(run)
    assert "most likely for what the warning says" in changed(run, warnings=["it does not fit"])


def test_errors_of_the_last_map_alone_are_told_as_such(tmp_path: Path) -> None:
    whole = changed(made_up_run(tmp_path / "whole", "k" * 10))
    assert "over 10 of 10 frames" in whole
    assert "last map only" not in whole
    states = "kkkkkkk" + "l" + "kk"
    page = changed(made_up_run(tmp_path / "parted", states, maps="0" * 8 + "11"))
    note, _, tiles = page.partition('class="tiles"')
    assert "The errors are over 2 of 10 frames, the main map only" in note
    assert "over 2 of 10 frames, the main map only" in tiles


def test_the_first_finding_in_a_loaded_map(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", "lkkkkkkrlkk")
    loaded = {"file": "a.orbmap", "keyframes": 1, "map_points": 30, "runs": 2}
    page = changed(run, loaded_map=loaded, relocalisations=2)
    assert page.count("camera found in the loaded map") == page.count(
        "camera found again in the map"
    )
    assert "a.orbmap: 1 keyframe, 30 map points, 2 runs" in page
    assert "2, the first of them in the loaded map" in page
    assert "in the loaded map" not in changed(run, loaded_map=None)


def test_what_there_is_not_is_left_out(tmp_path: Path) -> None:
    page = changed(made_up_run(tmp_path / "nothing", "n" * 12))
    for left_out in ("length of the path", "KITTI", "plot-inliers", "plot-keyframes"):
        assert left_out not in page, left_out
    assert "plot-states" in page
    page = changed(made_up_run(tmp_path / "some"))
    assert "length of the path" in page
    assert "KITTI" not in page


def test_terms_are_explained(tmp_path: Path) -> None:
    page = changed(made_up_run(tmp_path / "r"))
    (tile,) = re.findall('<li title="([^"]*)"><b>[^<]*</b><span>absolute error', page)
    assert "turned and shifted" in tile
    assert "se3" not in page
    assert "p99" not in page
    times = {"median": 1.0, "mean": 1.0, "p99": 2.0, "count": 3}
    page = changed(tmp_path / "r", milliseconds={"mapping.fuse": times, "loop.graph": times})
    assert "joining points that are one" in page
    assert "spreading the correction over all keyframes" in page


def test_every_stage_beside_tracking_is_explained() -> None:
    """Read from the code that measures them."""
    slam = ROOT / "src/orbslam2py/slam"
    measured = set(
        re.findall(r'timer\("(mapping[.a-z_]*)"\)', (slam / "local_mapping.py").read_text())
    )
    for name, file in (
        ("loop", "loop_closing.py"),
        ("loop", "merging/map_merging.py"),
        ("adjustment", "full_bundle_adjustment.py"),
    ):
        found = re.findall(r'timer\("([a-z_]+)"\)', (slam / file).read_text())
        measured |= {f"{name}.{stage}" for stage in found}
    assert len(measured) > 10
    assert measured <= set(STAGES_BESIDE)


def test_map_points_are_seen_on_light_and_dark_ground() -> None:
    """By the contrast of colours that WCAG 2 wants for graphics: at least 3."""
    style = (ROOT / "src/orbslam2py/data/report_page/page.css").read_text()
    grounds = re.findall("--ground: #([0-9a-f]{6})", style)
    points = re.findall("--points: #([0-9a-f]{6})", style)
    assert len(grounds) == len(points) == 3
    for ground, point in zip(grounds, points, strict=True):
        low, high = sorted([luminance(ground), luminance(point)])
        assert (high + 0.05) / (low + 0.05) > 3.0


def luminance(colour: str) -> float:
    """Relative luminance of a colour, by WCAG 2."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
