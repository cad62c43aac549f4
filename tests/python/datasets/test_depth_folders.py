# SPDX-License-Identifier: BSD-3-Clause
"""Images and depth in two folders, without a list."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, SettingsError, open_sequence
from orbslam2py.datasets import open_input
from orbslam2py.datasets.depth_folders import DepthFolders
from orbslam2py.settings import Sensor, builtin_settings
from support.small_folders import image, save

SETTINGS = builtin_settings("tum3", Sensor.RGBD)


def phone(folder: Path, colour: list[str], depth: list[str]) -> Path:
    """A folder with images and depth under these names."""
    for k, name in enumerate(colour):
        save(folder / name, image(k, (48, 64, 3)))
    for k, name in enumerate(depth):
        save(folder / name, np.full((48, 64), 1000 + k, np.uint16))
    return folder


def names(first: str, n: int, begin: int = 0) -> list[str]:
    return [first % k for k in range(begin, begin + n)]


@pytest.mark.parametrize(
    ("colour", "depth"),
    [
        ("color/%06d.jpg", "depth16/%06d.png"),
        ("rgb/%d.png", "depth/%d.png"),
        ("images/a%03d.png", "z/b%03d.png"),
        ("left/%d.png", "depth_maps/%d.tiff"),
    ],
)
def test_pairs_are_found(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, colour: str, depth: str
) -> None:
    folder = phone(tmp_path / "phone", names(colour, 12), names(depth, 12))
    with caplog.at_level(logging.INFO):
        sequence = open_sequence(folder, settings=SETTINGS)
    (said,) = [record.getMessage() for record in caplog.records]
    assert Path(colour).parts[0] in said
    assert Path(depth).parts[0] in said
    assert "12 images" in said
    assert sequence.sensor is Sensor.RGBD
    assert [sequence.load(i).depth[0, 0] for i in range(12)] == list(range(1000, 1012))
    assert sequence.timestamps == pytest.approx(np.arange(12) / SETTINGS.camera.fps)


def test_equal_names_count_before_the_order(tmp_path: Path) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 5, 1), names("depth/%d.png", 5))
    sequence = open_sequence(folder, settings=SETTINGS)
    assert [sequence.load(i).depth[0, 0] for i in range(len(sequence))] == [1001, 1002, 1003, 1004]


@pytest.mark.parametrize(
    ("stems", "first"),
    [
        (["1403636579763555584", "1403636579813555456"], "1403636579.763555584"),
        (["1403636579763555", "1403636579813555"], "1403636579.763555"),
        (["100.25", "100.5"], "100.25"),
    ],
)
def test_names_that_are_times(tmp_path: Path, stems: list[str], first: str) -> None:
    colour, depth = ([f"{part}/{stem}.png" for stem in stems] for part in ("color", "depth"))
    sequence = open_sequence(phone(tmp_path / "p", colour, depth), settings=SETTINGS)
    assert sequence.timestamp_text(0) == first
    assert 0 < np.diff(sequence.timestamps)[0] < 1


def test_names_that_are_times_of_two_clocks(tmp_path: Path) -> None:
    colour = [f"color/{t:.3f}.png" for t in (1.0, 1.1, 1.2)]
    depth = [f"depth/{t:.3f}.png" for t in (1.105, 1.205)]
    sequence = open_sequence(phone(tmp_path / "p", colour, depth), settings=SETTINGS)
    assert sequence.timestamps == pytest.approx([1.1, 1.2])


def test_rate_and_times_are_taken(tmp_path: Path) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 3), names("depth/%d.png", 3))
    given = open_input(folder, "rgbd", settings=SETTINGS, fps=10)
    assert given.timestamps == pytest.approx([0, 0.1, 0.2])
    assert given.settings.camera.fps == 10
    (tmp_path / "t.txt").write_text("5\n6\n7.5\n")
    timed = open_input(folder, "rgbd", settings=SETTINGS, times=tmp_path / "t.txt")
    assert timed.timestamps == pytest.approx([5, 6, 7.5])


def test_images_alone(tmp_path: Path) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 3), names("depth/%d.png", 2))
    mono = open_sequence(folder, "mono", settings=builtin_settings("tum3", Sensor.MONOCULAR))
    assert len(mono) == 3
    assert mono.load(2).depth is None


def test_what_cannot_be_told(tmp_path: Path) -> None:
    folder = phone(
        tmp_path / "p", names("wide/%d.png", 3) + names("tele/%d.png", 2), names("depth/%d.png", 3)
    )
    with pytest.raises(DatasetError) as refused:
        open_input(folder, "rgbd", settings=SETTINGS)
    for part in ("wide (3 images, 8 bits)", "tele (2", "depth (3 images, 16 bits", "keep one"):
        assert part in str(refused.value)
    shutil.rmtree(folder / "depth")
    with pytest.raises(DatasetError, match="one of 16-bit depth"):
        open_sequence(folder, "rgbd", settings=SETTINGS)


def test_counts_that_differ(tmp_path: Path) -> None:
    folder = phone(tmp_path / "p", names("color/c%d.png", 3), names("depth/d%d.png", 4))
    with pytest.raises(DatasetError, match=r"color \(3 images.* and depth \(4 .*name them alike"):
        open_sequence(folder, settings=SETTINGS)


def test_sizes_that_differ(tmp_path: Path) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 2), [])
    for k in range(2):
        save(folder / f"depth/{k}.png", np.full((20, 32), 1000, np.uint16))
    with pytest.raises(ImageError, match=r"32x20, the image 64x48: .* register depth"):
        open_sequence(folder, settings=SETTINGS)


@pytest.mark.parametrize("half", ["color", "depth"])
def test_half_of_a_pair(tmp_path: Path, half: str) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 2), names("depth/%d.png", 2))
    with pytest.raises(DatasetError, match=r"images are in color, depth in depth; give the folder"):
        open_input(folder / half, "rgbd", settings=SETTINGS)


def test_settings_are_asked_for(tmp_path: Path) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 2), names("depth/%d.png", 2))
    with pytest.raises(DatasetError, match="its camera is unknown; give --settings"):
        open_sequence(folder)


@pytest.mark.parametrize("fps", [0, -5, np.nan, np.inf, "x", "10", True, 10**400])
@pytest.mark.parametrize("settings", [SETTINGS, None])
def test_a_rate_that_is_none(tmp_path: Path, fps: object, settings: object) -> None:
    folder = phone(tmp_path / "p", names("color/%d.png", 2), names("depth/%d.png", 2))
    with pytest.raises(SettingsError, match=r"^--fps: .*fps"):
        DepthFolders(folder, settings=settings, fps=fps)  # type: ignore[arg-type]
