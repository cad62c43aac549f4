# SPDX-License-Identifier: BSD-3-Clause
"""No command writes what it, or the next one, would read as a frame or as a calibration."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from orbslam2py import Sensor
from support.command_line import CommandLine, refused
from support.files import names_in
from support.small_folders import image, save
from support.small_sequences import sequence

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture
def street(tmp_path: Path) -> Path:
    return sequence(Sensor.STEREO, 12).write(tmp_path / "street")


@pytest.fixture
def plain(street: Path) -> Path:
    return Path(shutil.copytree(street / "image_0", "plain"))


def test_a_run_of_a_folder_of_images(command: CommandLine, plain: Path) -> None:
    before = names_in(plain)
    run = ("run", plain, "--settings", "tum1", "--force", "--quiet", "--output")
    refused(command(*run, plain), "plain is the folder of the images", "give another --output")
    refused(command(*run, plain, "--mask", _masks()), "plain is the folder of the images")
    assert names_in(plain) == before
    done = command(*run, plain / "runs", "--deterministic")
    assert done.code in (0, 4), done.err
    assert names_in(plain) == sorted([*before, "runs"])


def test_a_run_of_a_sequence(command: CommandLine, street: Path) -> None:
    before = names_in(street)
    run = ("run", street, "--sensor", "stereo", "--settings", "kitti00-02", "--force")
    refused(command(*run, "--output", street), "street is the folder of the sequence")
    refused(
        command(*run, "--output", street, "--video", street / "a.mp4"),
        "street is the folder of the sequence",
    )
    refused(command(*run, "--output", "street/image_1"), "the sequence's own")
    assert names_in(street) == before


def test_masks_are_not_joined_by_pictures(command: CommandLine, plain: Path) -> None:
    masks = _masks()
    before = names_in(masks)
    run = ("run", plain, "--settings", "tum1", "--force", "--quiet", "--mask", masks)
    refused(command(*run, "--output", masks), "--output masks is what is read")
    assert names_in(masks) == before


def test_the_picture_of_a_calibration_is_no_photograph_of_the_board(command: CommandLine) -> None:
    """The next calibration would search it for a board, and find images of two sizes."""
    save(Path("board/00.png"), image(0))
    board = ("calibrate", "board", "--board", "9x6", "--square", "0.02", "-o", "s.yaml")
    refused(command(*board, "--plot", "board/residuals.png"), "--plot board/residuals.png")
    refused(command(*board, "--plot", "./board/../board/new.png"), "give it another place")
    assert names_in(Path("board")) == ["00.png"]


def _masks() -> Path:
    for number in range(12):
        save(Path(f"masks/{number}.png"), image(0, (240, 320)) | 1)
    return Path("masks")
