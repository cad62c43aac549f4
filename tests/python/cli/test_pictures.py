# SPDX-License-Identifier: BSD-3-Clause
"""Pictures that commands write: what the ending says, with names in every script."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path

import cv2
import pytest

from orbslam2py import Sensor
from orbslam2py.batches.sweep_picture import write_sweep_picture
from support import chessboards
from support.command_line import CommandLine, refused
from support.files import names_in
from support.made_up_saved import map_file
from support.small_sequences import sequence

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture
def map_of_japan(tmp_path: Path) -> Path:
    return map_file(tmp_path, name="日本.orbmap")


@pytest.mark.parametrize(
    ("name", "begin"), [("a.png", b"\x89PNG"), ("a.jpg", b"\xff\xd8"), ("a.svg", b"<?xml")]
)
def test_the_picture_of_a_map(
    command: CommandLine, map_of_japan: Path, name: str, begin: bytes
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        done = command("map", "info", map_of_japan, "--picture", name)
    assert (done.code, done.err) == (0, "")
    assert Path(name).read_bytes().startswith(begin)


def test_another_ending_is_refused_before_the_map_is_read(command: CommandLine) -> None:
    Path("a.orbmap").write_text("no map")
    refused(
        command("map", "info", "a.orbmap", "--picture", "a.gif"),
        "--picture a.gif cannot be a picture",
        ".png, .jpg",
    )
    board = ("calibrate", "board.mp4", "--board", "9x6", "--square", "0.02", "-o", "s.yaml")
    refused(command(*board, "--plot", "a.bmp"), "--plot a.bmp cannot be a picture", ".png, .jpg")
    assert names_in(Path()) == ["a.orbmap"]


def test_the_picture_of_a_calibration(command: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "盤").mkdir()
    chessboards.write_views(tmp_path / "盤")
    board = ("calibrate", "盤", "--board", f"{chessboards.COLUMNS}x{chessboards.ROWS}")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        done = command(*board, "--square", "0.03", "-o", "s.yaml", "--plot", "a.jpg")
    assert (done.code, done.err) == (0, "")
    assert Path("a.jpg").read_bytes().startswith(b"\xff\xd8")
    assert cv2.imread("a.jpg").std() > 10


@pytest.mark.picture
def test_a_run_of_a_sequence_with_such_a_name(command: CommandLine, tmp_path: Path) -> None:
    folder = sequence(Sensor.RGBD, 12).write(tmp_path / "lap")
    shutil.move(folder, "日本")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        done = command("run", "日本", "--deterministic", "--output", "r", "--no-report", "--quiet")
    assert (done.code, done.err) == (0, "")
    assert cv2.imread("r/trajectory.png") is not None


def test_the_picture_of_a_sweep(tmp_path: Path) -> None:
    rows = [{"sequence": "日本", "sweep.orb": value, "ate_rmse_m": 0.1} for value in (1, 2)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert write_sweep_picture(tmp_path / "sweep.png", rows)
    assert cv2.imread(str(tmp_path / "sweep.png")) is not None
