# SPDX-License-Identifier: BSD-3-Clause
"""Small made-up sequences of every kind."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from support.numbered_images import coloured, write_video
from support.small_folders import write_euroc, write_kitti, write_tum


@pytest.fixture
def tum(tmp_path: Path) -> Path:
    """Four colour images; depth is late by 5 ms and missing for the third."""
    return write_tum(tmp_path / "rgbd_dataset_freiburg2_made_up")


@pytest.fixture
def kitti(tmp_path: Path) -> Path:
    """Three pairs of images."""
    return write_kitti(tmp_path / "dataset" / "sequences" / "07")


@pytest.fixture
def euroc(tmp_path: Path) -> Path:
    """Three pairs of images; the right camera is 10 cm to the right of the left one."""
    return write_euroc(tmp_path / "V9_01")


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty frames at 25 per second."""
    return write_video(tmp_path_factory.mktemp("video") / "walk.mp4")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Images 1.png to 12.png, which sort otherwise as text, and other files."""
    folder = tmp_path / "walk"
    folder.mkdir()
    for k in range(1, 13):
        assert cv2.imwrite(str(folder / f"{k}.png"), coloured(k))
    (folder / "notes.txt").write_text("no image\n")
    (folder / "._1.png").write_text("no image either\n")
    return folder
