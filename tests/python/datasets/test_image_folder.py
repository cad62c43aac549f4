# SPDX-License-Identifier: BSD-3-Clause
"""Folders of images: what they deliver, and bad ones."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, SettingsError
from orbslam2py.datasets import ImageFolder, Sequence, TumSequence, open_input
from orbslam2py.datasets.image_folder import natural_key
from orbslam2py.settings import builtin_settings
from support.numbered_images import MONO, coloured


def test_colour_order_follows_camera_rgb(folder: Path, tmp_path: Path) -> None:
    text = builtin_settings("tum1", MONO).to_yaml()
    images = []
    for value in (0, 1):
        path = tmp_path / f"{value}.yaml"
        path.write_text(text.replace("Camera.RGB: 1", f"Camera.RGB: {value}"))
        images.append(ImageFolder(folder, settings=path).load(4).image)
    np.testing.assert_array_equal(images[0], coloured(5))
    np.testing.assert_array_equal(images[1], coloured(5)[..., ::-1])


def test_image_folder_sorts_naturally(folder: Path) -> None:
    sequence: Sequence = open_input(folder, MONO, settings="tum1")  # type: ignore[assignment]
    assert isinstance(sequence, ImageFolder)
    assert (sequence.name, sequence.layout, len(sequence)) == ("walk", "images", 12)
    assert [path.name for path in sequence.paths] == [f"{k}.png" for k in range(1, 13)]
    np.testing.assert_allclose(sequence.timestamps, np.arange(12) / 30)


def test_natural_key_compares_mixed_names() -> None:
    names = ["b2", "a10b3", "a2b10", "a2b9", "10", "9", "a"]
    assert sorted(names, key=natural_key) == ["9", "10", "a", "a2b9", "a2b10", "a10b3", "b2"]


def test_image_folder_takes_settings_that_lie_in_it(folder: Path) -> None:
    with pytest.raises(SettingsError, match=r"no settings for .*orbslam2py calibrate"):
        ImageFolder(folder)
    builtin_settings("tum2", MONO).save(folder / "settings.yaml")
    assert ImageFolder(folder).settings == builtin_settings("tum2", MONO)
    assert ImageFolder(folder).default_settings() == builtin_settings("tum2", MONO)


def test_bad_image_folders(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match="no images in"):
        ImageFolder(tmp_path / "empty", settings="tum1")
    with pytest.raises(DatasetError, match=r"did you mean .*walk"):
        open_input(tmp_path, MONO, settings="tum1")
    with pytest.raises(DatasetError, match="does not exist"):
        open_input(tmp_path / "nowhere", MONO, settings="tum1")
    with pytest.raises(DatasetError, match="cannot list"):
        ImageFolder(tmp_path / "nowhere", settings="tum1")
    (folder / "3.png").write_bytes(b"")
    with pytest.raises(ImageError, match=r"3\.png is no readable image"):
        ImageFolder(folder, settings="tum1").load(2)


def test_options_that_a_known_layout_does_not_take(tmp_path: Path) -> None:
    tum = tmp_path / "freiburg1_x"
    tum.mkdir()
    cv2.imwrite(str(tum / "a.png"), coloured(1))
    (tum / "rgb.txt").write_text("1.0 a.png\n")
    assert isinstance(open_input(tum, MONO), TumSequence)
    with pytest.raises(DatasetError, match=r"--fps is for .*is tum"):
        open_input(tum, MONO, fps=20)
    with pytest.raises(DatasetError, match=r"--times is for .*is tum"):
        open_input(tum, MONO, times=tum / "rgb.txt")


def test_time_stamps_of_a_tum_list(tum: Path) -> None:
    images = ImageFolder(tum / "rgb", settings="tum1", times=tum / "rgb.txt")
    assert [images.timestamp_text(i) for i in range(4)] == [f"100.{k}00000" for k in range(4)]
    (tum / "rgb/100.200000.png").unlink()
    images = ImageFolder(tum / "rgb", settings="tum1", times=tum / "rgb.txt")
    assert [images.timestamp_text(i) for i in range(3)] == [f"100.{k}00000" for k in (0, 1, 3)]


def test_folders_that_are_called_like_images_are_none(folder: Path, tmp_path: Path) -> None:
    (folder / "sub.png").mkdir()
    (folder / "link.png").symlink_to(tmp_path)
    (folder / "13.png").symlink_to(folder / "12.png")
    (folder / "99.png").symlink_to(folder / "nowhere.png")
    names = [path.name for path in ImageFolder(folder, settings="tum1").paths]
    assert names == [*(f"{k}.png" for k in range(1, 14)), "99.png"]
    (tmp_path / "only").mkdir()
    (tmp_path / "only" / "sub.png").mkdir()
    with pytest.raises(DatasetError, match="no images in"):
        ImageFolder(tmp_path / "only", settings="tum1")
