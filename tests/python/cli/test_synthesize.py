# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py synthesize``."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from orbslam2py import SettingsError
from orbslam2py.cli.synthesize import parse_size, synthesize


@given(st.integers(1, 9999), st.integers(1, 9999))
def test_sizes_are_read(width, height):
    assert parse_size(f"{width}x{height}") == (width, height)


@pytest.mark.parametrize("text", ["640", "640x", "x480", "640x480x3", "-640x480", "a x b", ""])
def test_bad_sizes_are_refused(text):
    with pytest.raises(SettingsError, match="--size"):
        parse_size(text)


def run_command(*arguments: str):
    app = typer.Typer()
    app.command()(synthesize)
    return CliRunner().invoke(app, list(arguments))


def test_the_command_writes_what_it_was_asked_for(tmp_path):
    folder = tmp_path / "lap"
    options = (
        "--world corridor --sensor rgbd --layout tum --frames 4 --fps 15 --size 160x120 --seed 3 "
        "--noise 1 --exposure 0.9 --depth-noise 0.001"
    )
    result = run_command(str(folder), *options.split())
    assert result.exit_code == 0, result.output
    about = json.loads((folder / "synthetic.json").read_text())
    expected = {"world": "corridor", "frames": 4, "fps": 15, "size": [160, 120], "seed": 3}
    assert expected.items() <= about.items()
    image = cv2.imread(str(next(Path(folder / "rgb").iterdir())), cv2.IMREAD_UNCHANGED)
    assert image.shape == (120, 160)
    assert len(list((folder / "depth").iterdir())) == 4


def test_the_command_cuts_a_way_into_pieces(tmp_path):
    folder = tmp_path / "cut"
    options = (
        "--world corridor --sensor rgbd --frames 9 --size 160x120 "
        "--pieces 3 --order 2,0 --gap 0.1 --overlap 0.05 --cover 0:0.1"
    )
    result = run_command(str(folder), *options.split())
    assert result.exit_code == 0, result.output
    about = json.loads((folder / "synthetic.json").read_text())
    assert {"pieces": 3, "order": [2, 0], "gap": 0.1, "overlap": 0.05}.items() <= about.items()
    assert about["cover"] == [0.0, 0.1]
    assert len(list((folder / "rgb").iterdir())) == 4 + 2 + 4


def test_one_frame_is_called_so(tmp_path):
    for count, words in (("1", "1 frame is in "), ("2", "2 frames are in ")):
        result = run_command(str(tmp_path / count), "--frames", count, "--size", "64x64")
        assert words in result.output


def test_the_command_refuses_bad_input(tmp_path):
    assert run_command(str(tmp_path / "x"), "--world", "moon").exit_code == 2
    result = run_command(str(tmp_path / "x"), "--size", "big")
    assert isinstance(result.exception, SettingsError)  # main() makes it exit code 2
    assert not list(tmp_path.iterdir())
