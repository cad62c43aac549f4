# SPDX-License-Identifier: BSD-3-Clause
"""Comparisons with ground truth that make no sense."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py.trajectory import write_kitti, write_tum
from support.command_line import CommandLine
from support.made_up_paths import wander

N = 20
COLUMNS = "index,timestamp,map,state,reason"
MATRIX = "1 0 0 0.1\n0 1 0 0.2\n0 0 1 0.3\n"


@pytest.fixture(autouse=True)
def _files(tmp_path: Path) -> None:
    truth = wander(N)
    write_tum(tmp_path / "a.txt", truth)
    write_tum(tmp_path / "b.txt", truth)
    write_kitti(tmp_path / "rows.txt", truth)
    write_kitti(tmp_path / "poses.txt", truth)
    write_kitti(tmp_path / "dense.txt", wander(3 * N))
    (tmp_path / "stamps.txt").write_text("".join(f"{t}\n" for t in truth.timestamps))
    (tmp_path / "empty").mkdir()


@pytest.mark.parametrize(
    ("arguments", "thing", "remedy"),
    [
        ("a.txt poses.txt", "poses.txt has 20 poses without time stamps", "--times"),
        ("rows.txt b.txt", "rows.txt has 20 rows without time stamps", "--times"),
        ("rows.txt dense.txt", "rows.txt has 20 rows", "frames.csv"),
        ("dense.txt poses.txt", "dense.txt has 60 rows", "trajectory.txt"),
        ("a.txt poses.txt --times none.txt", "cannot open none.txt", "No such file"),
        ("a.txt b.txt --times stamps.txt", "stamps.txt is not needed", "leave out --times"),
        ("a.txt dense.txt --times stamps.txt", "stamps.txt holds 20", "one per row"),
        ("a.txt poses.txt --times poses.txt", "poses.txt:1", "one per line"),
        ("rows.txt poses.txt --offset 1", "--offset has no meaning", "leave it out"),
        ("a.txt b.txt --offset nan", "--offset is nan", "a number of seconds"),
        ("a.txt b.txt --offset 500", "no time stamps of estimate", "--offset"),
        ("a.txt b.txt --extrinsics none.yaml", "cannot open none.yaml", "No such file"),
        ("a.txt b.txt --extrinsics a.txt", "a.txt does not hold 12 or 16 numbers", "T_BS"),
        ("a.txt empty", "empty", "TUM"),
    ],
)
def test_refused(command: CommandLine, arguments: str, thing: str, remedy: str) -> None:
    done = command("evaluate", *arguments.split(), "--json", "figures.json")
    assert done.code == 2, done.out + done.err
    assert thing in done.err
    assert remedy in done.err
    assert "Errno" not in done.err
    assert not Path("figures.json").exists()


@pytest.mark.parametrize(
    "text",
    ["1 2 3", "", MATRIX.replace("1 0 0", "2 0 0"), MATRIX + "0 0 1 1", MATRIX.replace("1", "x")],
)
@pytest.mark.parametrize("name", ["m.txt", "m.yaml"])
def test_extrinsics_that_are_none(command: CommandLine, text: str, name: str) -> None:
    Path(name).write_text(text)
    done = command("evaluate", "a.txt", "b.txt", "--extrinsics", name)
    assert done.code == 2
    assert name in done.err
    assert "T_BS" in done.err


@pytest.mark.parametrize("data", ["[1, 2]", "[" + ", ".join(["1"] * 16) + "]", "none"])
def test_matrix_of_a_sensor_file_that_is_none(command: CommandLine, data: str) -> None:
    Path("cam.yaml").write_text(f"T_BS:\n  rows: 4\n  cols: 4\n  data: {data}\n")
    done = command("evaluate", "a.txt", "b.txt", "--extrinsics", "cam.yaml")
    assert done.code == 2
    assert "cam.yaml" in done.err


@pytest.mark.parametrize(
    ("text", "line"),
    [(f"{COLUMNS}\n0,x,0,OK,\n", 2), (f"{COLUMNS}\n0,1.0,0,OK,\n0\n", 3)],
)
def test_frames_of_a_run_that_are_none(command: CommandLine, text: str, line: int) -> None:
    Path("frames.csv").write_text(text)
    done = command("evaluate", "rows.txt", "poses.txt")
    assert done.code == 2
    assert f"frames.csv:{line}" in done.err
    assert "move the file away" in done.err


@pytest.mark.parametrize("text", ["nothing\n1\n", "index\n0\n", ""])
def test_frames_of_another_program_are_left_alone(command: CommandLine, text: str) -> None:
    Path("frames.csv").write_text(text)
    assert command("evaluate", "rows.txt", "poses.txt").code == 0


@pytest.mark.parametrize(("times", "line"), [("1\n0\n2\n", 2), ("0\n2\n1\n", 3)])
def test_times_that_go_back(command: CommandLine, times: str, line: int) -> None:
    Path("back.txt").write_text(times)
    done = command("evaluate", "a.txt", "poses.txt", "--times", "back.txt")
    assert done.code == 2
    assert f"back.txt:{line}: the time stamp is before the one above it" in done.err
