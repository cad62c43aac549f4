# SPDX-License-Identifier: BSD-3-Clause
"""The page of a run: made from its folder, whatever the run was like."""

from __future__ import annotations

import json
import re
import zipfile
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py.maps.ply import read_points, write_ply
from orbslam2py.runs.frame_errors import worst_places
from orbslam2py.runs.report_page import write_report_page
from orbslam2py.runs.report_page.explained import FIGURES, STAGES
from orbslam2py.runs.report_page.markup import element, join
from orbslam2py.runs.report_page.round_numbers import (
    path_data,
    round_down,
    round_ticks,
    short,
    thin,
)
from orbslam2py.runs.report_page.run_folder import read_run
from orbslam2py.runs.report_page.story import Story
from support.documents import ROOT, cells_of, read
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.page


class Page(HTMLParser):
    """What is in a page: ids, elements, text, links within it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.elements: list[str] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        assert self.open == [], "every element is closed"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        if tag not in ("meta", "link", "img", "input", "br"):
            self.open.append(tag)
        values = dict(attrs)
        assert not [name for name in values if name.startswith("on")], "no script in attributes"
        if values.get("id"):
            self.ids.append(str(values["id"]))
        if values.get("href"):
            self.links.append(str(values["href"]))
        if tag in ("img", "svg"):
            assert values.get("alt") or values.get("aria-label"), "said in words as well"

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["script"], ["style"]):
            self.texts.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


def page_of(folder: Path) -> Page:
    page = Page((folder / "report.html").read_text())
    assert len(page.ids) == len(set(page.ids))
    inner = {link[1:] for link in page.links if not re.match(r"#frame-|data:", link)}
    assert inner <= set(page.ids)
    return page


def test_everything_is_there(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", "nn" + "k" * 30 + "rll" + "k" * 30 + "d")
    page = page_of(run)
    plots = {name for name in page.ids if name.startswith("plot-")}
    assert plots == {
        *("plot-error", "plot-states", "plot-inliers", "plot-keyframes"),
        *("plot-times", "plot-histogram"),
    }
    parts = {"path", "error", "tracking", "times", "images", "figures", "repeat"}
    assert parts <= set(page.ids)
    assert page.elements.count("img") >= 8
    for said in (
        *("60 of 66", "too few keypoints", "orbslam2py run circle", "2026-01-02 03:04"),
        *("tracking lost for 3 frames", "camera found again", "loop closed: keyframe"),
    ):
        assert said in page.text, said
    report = json.loads((run / "report.json").read_text())
    assert f"{report['ate_rmse_m']:.4g}" in page.text


@pytest.mark.parametrize(
    ("states", "how"),
    [
        ("k" * 12, {"has_truth": False}),
        ("k" * 12, {"sensor": "mono", "has_truth": False}),
        ("k" * 12, {"sensor": "mono"}),
        ("n" * 12, {}),
        ("sd" * 6, {}),
        ("k", {}),
        ("n", {}),
        ("kk", {}),
        ("", {}),
        ("kkkkkn" * 4 + "kkkk", {"maps": "000000111111222222333333" + "4444", "sensor": "mono"}),
        ("kkkk" + "l" * 9, {"maps": "0" * 13}),
        ("kkkkknnnn", {"maps": "0" * 5 + "1" * 4}),
    ],
    ids=str,
)
def test_any_run_has_a_page(tmp_path: Path, states: str, how: dict[str, object]) -> None:
    run = made_up_run(tmp_path / "r", states, **how)  # type: ignore[arg-type]
    page = page_of(run)
    report = json.loads((run / "report.json").read_text())
    assert ("plot-error" in page.ids) == (report.get("ate_rmse_m") is not None)
    assert "plot-states" in page.ids
    assert "nan" not in (run / "report.html").read_text().partition("<body>")[2].lower()
    if how.get("sensor") == "mono" and how.get("has_truth") is False:
        assert "map's own units" in page.text
        assert " m " not in page.text.partition("All figures")[0]
    if "4" in str(how.get("maps")):
        assert [f"map-{number}" in page.ids for number in range(5)] == [True] * 5
        assert "plot-maps" in page.ids
        assert "Map 4, the main one" in page.text
        assert "relative position of two maps has no meaning" in page.text
    if "maps" not in how:
        assert "maps" not in page.ids, "nothing is said of several maps where there is one"


def test_weak_evidence_is_shown(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "weak", "kkkwwkkkwkkk")
    assert json.loads((run / "report.json").read_text())["weak_frames"] == 3
    page = page_of(run)
    assert "tracked with weak evidence: 3" in page.text
    assert "tracked: 9" in page.text
    assert "plot-found" in page.ids
    plain = page_of(made_up_run(tmp_path / "plain", "k" * 12))
    assert "weak evidence" not in plain.text
    assert "plot-found" not in plain.ids


@pytest.mark.parametrize(
    "text", ["<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a&b"]
)
def test_texts_are_no_markup(tmp_path: Path, text: str) -> None:
    run = made_up_run(tmp_path / "r", "kkkkkk" + "s" * 3, name=text, command=f"orbslam2py {text}")
    frames = (run / "frames.csv").read_text().replace("image 7 is empty", text.replace('"', "'"))
    (run / "frames.csv").write_text(frames)
    write_report_page(run / "report.html", run)
    page = page_of(run)
    assert text in page.text
    assert page.elements.count("script") == 2, "its data and its script"


def test_a_script_that_slipped_in_would_not_run() -> None:
    policy = "default-src 'none'; script-src 'sha256-"
    page = (ROOT / "src/orbslam2py/runs/report_page/page.py").read_text()
    assert policy in page


def test_markup_and_text() -> None:
    inner = element("b", "1 < 2", title='"')
    assert inner == '<b title="&quot;">1 &lt; 2</b>'
    assert element("p", inner, None, " & ", hidden=True, class_="x", data_a=None) == (
        f'<p hidden class="x">{inner} &amp; </p>'
    )
    assert join("<", inner) == f"&lt;{inner}"


# ---- the files -----------------------------------------------------------------------------------
def test_made_again_it_is_the_same(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r")
    first = (run / "report.html").read_bytes()
    write_report_page(run / "again.html", run)
    assert (run / "again.html").read_bytes() == first


def test_files_may_lie_in_two_folders(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r")
    first = (run / "report.html").read_bytes()
    rescue = tmp_path / "rescue"
    rescue.mkdir()
    for name in ("report.json", "trajectory.txt", "points.ply"):
        (run / name).rename(rescue / name)
    write_report_page(run / "again.html", [run, rescue])
    assert (run / "again.html").read_bytes() == first


def test_an_older_run_has_a_page(tmp_path: Path) -> None:
    """Files that came later may be missing."""
    run = made_up_run(tmp_path / "r")
    for name in ("groundtruth_aligned.txt", "frame_images.zip", "points.ply", "keyframes.txt"):
        (run / name).unlink()
    report = json.loads((run / "report.json").read_text())
    for key in ("options", "command", "command_folder", "started", "machine", "losses"):
        del report[key]
    (run / "report.json").write_text(json.dumps(report))
    write_report_page(run / "report.html", run)
    page = page_of(run)
    assert "images" not in page.ids
    assert "ATE, RMSE" in page.text, "a figure of the report"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("report.json", None, "holds no run: report.json is missing"),
        ("report.json", '{"sequence":', "report.json cannot be read"),
        ("report.json", "[1]", "is no report of a run"),
        ("frames.csv", None, "holds no whole run: frames.csv is missing"),
        (
            "frames.csv",
            "index,timestamp\n1,",
            "frames.csv:2: '' in the column timestamp is no number",
        ),
        ("frames.csv", "", "frames.csv is empty"),
        ("trajectory.txt", "1 2 3", "trajectory.txt:1"),
        ("points.ply", "ply\n", "points.ply is no binary PLY"),
        ("frame_images.zip", "no zip", "frame_images.zip cannot be read"),
    ],
)
def test_folders_that_are_no_whole_run(
    tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    run = made_up_run(tmp_path / "r", "k" * 12)
    page = (run / "report.html").read_bytes()
    (run / name).unlink()
    if content is not None:
        (run / name).write_text(content)
    with pytest.raises(DatasetError, match=re.escape(message)):
        write_report_page(run / "report.html", run)
    assert (run / "report.html").read_bytes() == page


def test_images_show_points(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", "k" * 20 + "rl" + "k" * 10)
    with zipfile.ZipFile(run / "frame_images.zip") as archive:
        images = {
            name: cv2.imdecode(np.frombuffer(archive.read(name), np.uint8), cv2.IMREAD_COLOR)
            for name in archive.namelist()
        }
    assert "000020.jpg" in images, "where tracking was lost"
    assert all(image.shape == (60, 80, 3) for image in images.values())
    assert len(images) > 8


# ---- what it says --------------------------------------------------------------------------------
def test_errors_are_those_of_the_report(tmp_path: Path) -> None:
    for sensor in ("rgbd", "mono"):
        run = made_up_run(tmp_path / sensor, "nn" + "k" * 60, sensor=sensor, noise=0.05)
        story = Story.of(read_run(run))
        errors = story.errors[np.isfinite(story.errors)]
        report = json.loads((run / "report.json").read_text())
        assert len(errors) == report["matched_poses"]
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(report["ate_rmse_m"], rel=1e-5)
        assert errors.max() == pytest.approx(report["ate_max_m"], rel=1e-5)
        assert story.worst[0].value == errors.max()


def test_worst_places() -> None:
    errors = np.full(100, 0.1)
    errors[[20, 22, 70]] = [5.0, 4.0, 3.0]
    errors[50] = np.nan
    assert worst_places(errors)[:2].tolist() == [20, 70], "22 belongs to 20"
    assert worst_places(np.full(5, np.nan)).tolist() == []
    assert worst_places(np.zeros(5)).tolist() == []
    assert worst_places(np.ones(1)).tolist() == [0]


#: Keys that are no single figure, or that the page tells elsewhere.
ELSEWHERE = {
    *("imu", "input", "alignment"),
    *("settings", "options", "command", "command_folder", "machine", "milliseconds", "losses"),
    *(
        "maps",
        "main_map",
        "loops",
        "full_adjustments",
        "lost_reasons",
        "initialisation_reasons",
    ),
    *("matched_from_s", "matched_to_s", "warnings", "final_adjustment"),
}


def test_figures_are_those_of_the_documentation() -> None:
    page = read(ROOT / "docs/reference/files.md")
    section = page.partition("## report.json")[2].partition("### The entry")[0]
    rows = [cells_of(line) for line in section.splitlines() if line.startswith("| `")]
    units = {row[0].strip("`"): row[1] for row in rows}
    known = {figure.key: figure for group in FIGURES.values() for figure in group}
    assert set(known) == set(units) - ELSEWHERE
    for key, figure in known.items():
        assert figure.unit == units[key], key
        assert figure.text, key
    stages = [name for name in STAGES if f"| `ms_{name}` | ms | {STAGES[name]} |" in page]
    assert stages == list(STAGES)


# ---- lines and numbers ---------------------------------------------------------------------------
def test_round_numbers() -> None:
    assert round_ticks(0.0, 8.3, 6).tolist() == [0, 2, 4, 6, 8]
    np.testing.assert_allclose(
        round_ticks(-0.31, 0.22, 6), [-0.3, -0.2, -0.1, 0, 0.1, 0.2], atol=1e-12
    )
    assert [round_down(x) for x in (0.3, 1.0, 49, 50)] == pytest.approx([0.2, 1, 20, 50])
    told = [short(x) for x in (0, 0.04902, 51.38, 1234.5, 2.5e7, 1e-9, float("nan"))]
    assert told == ["0", "0.0490", "51.4", "1234", "2.5e+07", "1e-09", "\N{EN DASH}"]


def test_thin_lines_keep_what_sticks_out() -> None:
    x = np.arange(50_000.0)
    y = np.zeros(50_000)
    y[31_234], y[17], y[40_000:41_000] = 9.0, -9.0, np.nan
    tx, ty = thin(x, y)
    assert len(tx) < 2000
    assert (np.diff(tx) > 0).all()
    assert (np.nanmax(ty), np.nanmin(ty)) == (9.0, -9.0)
    assert tx[np.nanargmax(ty)] == 31_234
    gap = tx[np.isnan(ty)]
    assert gap.min() >= 40_000 and gap.max() < 41_000
    data = path_data(np.array([0, 1, 2, 3, 4.0]), np.array([5, 6, np.nan, 7, np.nan]))
    assert data == "M0.0 5.0h0L1.0 6.0M3.0 7.0h0"


def test_points_are_read_back(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    write_ply(tmp_path / "p.ply", points)
    np.testing.assert_allclose(read_points(tmp_path / "p.ply"), points, atol=1e-6)
    head = (tmp_path / "p.ply").read_bytes()
    (tmp_path / "half.ply").write_bytes(head[:-8])
    with pytest.raises(DatasetError, match=r"half.ply is not whole"):
        read_points(tmp_path / "half.ply")
