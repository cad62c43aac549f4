# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks: the figures are those of `evaluate`, and all runs are shown."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.batches import BenchmarkResult, StandardSet, benchmark
from orbslam2py.batches.standard_sets.entries import Entry, is_lost
from orbslam2py.batches.standard_sets.find import find_sequences
from orbslam2py.batches.standard_sets.markdown import markdown_table
from orbslam2py.batches.standard_sets.published import published_figures
from orbslam2py.datasets import open_sequence
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.browser import Browser
from support.command_line import logging_restored
from support.data import shared_folder
from support.standard_sets import make_root

#: Cells whose text is wider than they are.
OVERFLOWING = """[...document.querySelectorAll("td")].filter(
  (cell) => cell.scrollWidth > cell.clientWidth + 1).map((cell) => cell.innerText)"""

KINDS = ("tum", "kitti", "euroc")
SENSORS = {"tum": ["mono", "rgbd"], "kitti": ["mono", "stereo"], "euroc": ["mono", "stereo"]}


@pytest.fixture(scope="module")
def roots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("roots")
    return {kind: make_root(folder / kind, kind, frames=14) for kind in KINDS}


@pytest.fixture(scope="module")
def results(
    roots: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, BenchmarkResult]:
    folder = tmp_path_factory.mktemp("results")
    return {
        kind: benchmark(
            kind, root, folder / kind, seeds=2, options={"deterministic": True}, workers=0
        )
        for kind, root in roots.items()
    }


@pytest.mark.parametrize("kind", KINDS)
def test_figures_are_those_of_evaluate(
    results: dict[str, BenchmarkResult], kind: str, tmp_path: Path
) -> None:
    from orbslam2py.cli.evaluate import evaluate  # noqa: PLC0415

    done = results[kind]
    assert [entry.sensor for entry in done.entries] == SENSORS[kind]
    assert (len(done.batch.rows), done.batch.n_failed) == (4, 0)
    text = done.table.read_text()
    for row in done.batch.rows:
        figures = tmp_path / f"{row['run']}.json"
        run = done.batch.folder / "runs" / row["run"]
        with logging_restored():
            evaluate(run / "trajectory.txt", Path(row["path"]), json=figures)
        told = json.loads(figures.read_text())
        for name in ("ate_rmse_m", "t_rel_percent", "r_rel_deg_per_100m"):
            if told[name] is None:
                assert row.get(name) is None
            else:
                assert math.isclose(row[name], told[name], rel_tol=1e-4), name
        assert told["ate_rmse_m"] > 0
        assert f"{row['ate_rmse_m']:.3f}" in text


def test_published_figures_stand_beside_ours(results: dict[str, BenchmarkResult]) -> None:
    lines = results["euroc"].table.read_text().splitlines()
    tables = [line for line in lines if line.startswith("| MH_01_easy")]
    assert len(tables) == 2
    assert "| 0.016 |" in tables[0]
    assert "| 0.035 | 0.029 |" in tables[1]
    assert "| 0.8 |" in results["kitti"].table.read_text()
    assert "| 0.016 |" in results["tum"].table.read_text()
    page = results["tum"].page.read_text()
    assert "Transactions on Robotics 33(5), 2017" in page
    for row in results["tum"].batch.rows:
        assert row["run"].removeprefix("rgbd_dataset_") in page.replace("<wbr>", "")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as opened:
        yield opened


@pytest.mark.parametrize("width", [1440, 390])
def test_page_in_a_browser(
    results: dict[str, BenchmarkResult], browser: Browser, width: int
) -> None:
    for done in results.values():
        page = browser.open(done.page.as_uri(), width=width, dark=width == 390)
        page.wait_for("document.body.dataset.ready")
        asked = [address for address in page.requests if not address.startswith("data:")]
        assert asked == [done.page.as_uri()]
        assert page.errors == []
        assert page.evaluate("document.documentElement.scrollWidth") == width
        assert page.evaluate("document.querySelectorAll('figure.plot svg').length") == 4
        seen = "document.querySelectorAll('svg path.line.run0, svg path.line.run1').length"
        assert page.evaluate(seen) >= 4
        assert page.evaluate("document.querySelectorAll('#runs tbody tr').length") == 4
        assert page.evaluate(OVERFLOWING) == [], "no name runs into the figures"
        page.close()


def row_of(**more: object) -> dict[str, object]:
    usual: dict[str, object] = {"state": "done", "frames": 100, "tracked": 90, "seed": 0}
    return {**usual, "run": "a-seed0", "matched_of_poses": 90, "ate_rmse_m": 0.1, **more}


def test_lost_runs() -> None:
    assert not is_lost(row_of())
    assert is_lost(row_of(matched_of_poses=70))  # the path is that of the last map
    assert is_lost(row_of(state="failed", frames=None))
    assert not is_lost(row_of(matched_of_poses=None, tracked=85))
    assert is_lost(row_of(matched_of_poses=None, tracked=0))
    rows = [row_of(), row_of(matched_of_poses=10, ate_rmse_m=9.0), row_of(ate_rmse_m=0.3)]
    entry = Entry("00", "stereo", rows, published_figures("kitti", "00", "stereo"))
    assert entry.n_lost == 1
    spread = entry.spread("ate_rmse_m")
    assert spread is not None
    assert (spread.least, spread.most) == (0.1, 0.3)
    table = markdown_table(StandardSet.KITTI, [entry])
    assert "| 1 of 3 | 0.100, X (9.000), 0.300 |" in table
    assert "| 1.3 |" in table


def test_published_names() -> None:
    """Only folders that hold the whole sequence by their names have published figures."""
    (lost,) = [
        one for one in published_figures("euroc", "V2_03_difficult", "stereo") if one.is_lost
    ]
    assert lost.system == "ORB-SLAM2"
    assert published_figures("euroc", "cut_V1_01_easy", "stereo") == []
    assert published_figures("tum", "rgbd_dataset_freiburg1_desk", "mono") == []
    (with_imu,) = published_figures("euroc", "V2_03_difficult", "mono", imu=True)
    assert (with_imu.system, with_imu.ate_rmse_m) == ("ORB-SLAM3", 0.027)
    assert published_figures("kitti", "00", "stereo", imu=True) == []
    (room,) = published_figures("tum-vi", "dataset-room2_512_16", "stereo", imu=True)
    assert room.ate_rmse_m == 0.012
    (outdoors,) = published_figures("tum-vi", "outdoors7", "mono", imu=True)
    assert outdoors.ate_rmse_m == 7.6
    (desk,) = published_figures("tum", "freiburg1_desk", "rgbd")
    assert desk.ate_rmse_m == 0.016
    assert re.search(r"2017.*Table III", desk.source)


def test_published_means() -> None:
    """The tables of ORB-SLAM3 print averages, which the figures must have."""
    sequences = [f"MH_0{k}" for k in range(1, 6)] + [
        f"V{k}_0{n}" for k in (1, 2) for n in (1, 2, 3)
    ]
    for system, sensor, mean in (
        ("ORB-SLAM3", "mono", 0.041),
        ("ORB-SLAM3", "stereo", 0.084),
        ("ORB-SLAM2", "stereo", 0.044),
    ):
        values = [
            one.ate_rmse_m
            for name in sequences
            for one in published_figures("euroc", name, sensor)
            if one.system == system and one.ate_rmse_m is not None
        ]
        assert len(values) >= 10
        assert round(sum(values) / len(values), 3) == mean


def test_resume_and_parts(roots: dict[str, Path], tmp_path: Path) -> None:
    options = {"deterministic": True, "max_frames": 5}
    first = benchmark(
        "tum", roots["tum"], tmp_path / "o", sensors=["rgbd"], seeds=1, options=options, workers=0
    )
    assert [row["run"] for row in first.batch.rows] == [
        "rgbd_dataset_freiburg1_desk-rgbd-deterministic=true-max_frames=5-seed0"
    ]
    assert "Only parts of the sequences were run" in first.page.read_text()
    made: list[str] = []
    again = benchmark(
        "tum", roots["tum"], tmp_path / "o", sensors=["rgbd"], seeds=2, options=options,
        workers=0, resume=True, progress=lambda row, n, total: made.append(row["run"]),
    )  # fmt: skip
    assert len(made) == 1
    assert len(again.batch.rows) == 2


def test_a_sequence_that_cannot_be_opened_is_a_row(tmp_path: Path) -> None:
    root = make_root(tmp_path / "root", "tum", frames=3)
    broken = root / "rgbd_dataset_freiburg1_room"
    broken.mkdir()
    for name in ("rgb.txt", "depth.txt"):
        (broken / name).write_text("nonsense\n")
    done = benchmark("tum", root, tmp_path / "o", sensors=["rgbd"], seeds=1, workers=0)
    rows = {row["sequence"]: row for row in done.batch.rows}
    assert rows[broken.name]["state"] == "failed"
    page = done.page.read_text()
    assert "rgb.txt:1: expected" in page[page.index("Why runs failed") :]
    with Browser() as browser:  # a long reason leaves the figures where they are seen
        tab = browser.open(done.page.as_uri(), width=1440)
        seen = "(box => box.querySelector('table').offsetWidth <= box.clientWidth)"
        assert tab.evaluate(f"{seen}(document.querySelector('#runs .wide'))")
        assert tab.errors == []
    assert "rgbd_dataset_freiburg1_room |  |" in done.table.read_text()


def test_equal_names_are_told_apart(tmp_path: Path) -> None:
    make_root(tmp_path / "root/one", "tum", frames=3)
    make_root(tmp_path / "root/two", "tum", frames=3)
    (tmp_path / "root/two/again").symlink_to(tmp_path / "root")  # a circle
    found = find_sequences("tum", tmp_path / "root")
    name = "rgbd_dataset_freiburg1_desk"
    assert list(found) == [f"one/{name}", f"two/{name}"]


@pytest.mark.shared
@pytest.mark.parametrize(
    ("kind", "name", "sensor"),
    [
        ("kitti", "kitti_06_head51_stereo", "stereo"),
        ("tum", "7scenes_redkitchen_head250", "rgbd"),
    ],
)
def test_real_pieces(kind: str, name: str, sensor: str, tmp_path: Path) -> None:
    data = shared_folder() / "sequences"
    if not data.is_dir():
        pytest.skip(f"{data} is missing; ORBSLAM2PY_SHARED names the folder of the extra data")
    (tmp_path / "root").mkdir()
    (tmp_path / "root" / name).symlink_to(data / name)
    options = {"deterministic": True, "max_frames": 40}
    done = benchmark(
        kind, tmp_path / "root", tmp_path / "o", sensors=[sensor], seeds=1, options=options,
        workers=0,
    )  # fmt: skip
    (entry,) = done.entries
    assert entry.published == []
    assert entry.n_lost == 0
    spread = entry.spread("ate_rmse_m")
    assert spread is not None
    assert spread.median < 0.3


def test_tum_vi_is_told_from_euroc(tmp_path: Path) -> None:
    options = SyntheticOptions(world="room", sensor="stereo", frames=3, size=(320, 240), imu=True)
    for name in ("MH_01_easy", "dataset-room1_512_16"):
        SyntheticSequence(options).write(tmp_path / name)
    there = tmp_path / "dataset-room1_512_16" / "mav0"
    (there / "state_groundtruth_estimate0").rename(there / "mocap0")
    assert list(find_sequences("euroc", tmp_path)) == ["MH_01_easy"]
    assert list(find_sequences("tum-vi", tmp_path)) == ["dataset-room1_512_16"]
    path, same = (open_sequence(folder).ground_truth() for folder in tmp_path.iterdir())
    assert path is not None and same is not None
    np.testing.assert_array_equal(path.T_wc, same.T_wc)
