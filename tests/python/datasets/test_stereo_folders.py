# SPDX-License-Identifier: BSD-3-Clause
"""Images of a left and a right camera, without a list: in two folders, or in one."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, Sensor, Settings, open_sequence
from orbslam2py.datasets import ImageFolder, StereoFolders, open_input
from orbslam2py.datasets.pair_names import find_series, side_of_pair
from orbslam2py.settings import builtin_settings, settings_for_camera
from support.small_folders import image, save

STEREO = builtin_settings("kitti04-12", Sensor.STEREO)
MONO = builtin_settings("kitti04-12", Sensor.MONOCULAR)
N = 5


def write(folder: Path, left: str, right: str, n: int = N, right_from: int = 0) -> Path:
    """Left images of grey values 0, 1 ..., right ones of 100, 101 ..., by these names."""
    for k in range(n):
        save(folder / (left % k), np.full((48, 64), k, np.uint8))
        save(folder / (right % (k + right_from)), np.full((48, 64), 100 + k, np.uint8))
    return folder


def values(sequence: object) -> list[tuple[int, int]]:
    loaded = [sequence.load(i) for i in range(len(sequence))]  # type: ignore[attr-defined, arg-type]
    return [(int(one.image[0, 0]), int(one.right[0, 0])) for one in loaded]


PAIRS = [(k, 100 + k) for k in range(N)]


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left/%d.png", "right/%d.png"),
        ("image_0/%06d.png", "image_1/%06d.png"),
        ("image_2/%06d.png", "image_3/%06d.png"),
        ("cam0/%d.png", "cam1/%d.png"),
        ("infra1/%d.png", "infra2/%d.png"),
        ("l/%d.png", "r/%d.png"),
        ("left_rgb/%d.png", "right_rgb/%d.png"),
        ("image_left/%03d_left.png", "image_right/%03d_right.png"),
        ("L/l%d.png", "R/r%d.png"),
    ],
)
@pytest.mark.parametrize("opener", [open_sequence, open_input])
def test_two_folders(tmp_path: Path, left: str, right: str, opener: object) -> None:
    folder = write(tmp_path / "pair", left, right)
    sequence = opener(folder, settings=STEREO)  # type: ignore[operator]
    assert isinstance(sequence, StereoFolders)
    assert sequence.sensor is Sensor.STEREO
    assert values(sequence) == PAIRS
    assert sequence.timestamps == pytest.approx(np.arange(N) / STEREO.camera.fps)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left_%04d.png", "right_%04d.png"),
        ("%04d_l.png", "%04d_r.png"),
        ("%06d_left.png", "%06d_right.png"),
        ("imageLeft%d.png", "imageRight%d.png"),
        ("L%d.png", "R%d.png"),
        ("cam0_%04d.png", "cam1_%04d.png"),
        ("infra1-%d.png", "infra2-%d.png"),
    ],
)
@pytest.mark.parametrize("opener", [open_sequence, open_input])
def test_two_series_in_one_folder(tmp_path: Path, left: str, right: str, opener: object) -> None:
    folder = write(tmp_path / "pair", left, right)
    sequence = opener(folder, settings=STEREO)  # type: ignore[operator]
    assert sequence.sensor is Sensor.STEREO
    assert values(sequence) == PAIRS


@pytest.mark.parametrize("names", [("left_%04d.png", "right_%04d.png"), ("l/%d.png", "r/%d.png")])
def test_the_left_images_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, names: tuple[str, str]
) -> None:
    folder = write(tmp_path / "pair", *names)
    with caplog.at_level(logging.INFO):
        sequence = open_input(folder, "mono", settings=MONO)
    assert [int(sequence.load(i).image[0, 0]) for i in range(len(sequence))] == list(range(N))  # type: ignore[union-attr, arg-type]
    assert f"taking the {N} left images alone" in caplog.text


def test_a_folder_of_images_never_goes_on_with_the_right_ones(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = write(tmp_path / "pair", "left_%04d.png", "right_%04d.png")
    sequence = ImageFolder(folder, settings=MONO)
    assert [path.name for path in sequence.paths] == [f"left_{k:04d}.png" for k in range(N)]
    assert f"taking the {N} left images alone" in caplog.text


def test_settings_of_one_camera_take_the_left_images(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = write(tmp_path / "pair", "left_%04d.png", "right_%04d.png")
    sequence = open_input(folder, settings=MONO)
    assert sequence.sensor is Sensor.MONOCULAR
    assert "the settings are of a single camera" in caplog.text


def test_names_that_are_times(tmp_path: Path) -> None:
    for k in range(3):
        stamp = 1403636579_000000000 + k * 50_000_000
        save(tmp_path / "p" / f"left_{stamp}.png", np.full((48, 64), k, np.uint8))
        if k != 1:  # the right one of the second is missing; the others are 3 us late
            save(tmp_path / "p" / f"right_{stamp + 3000}.png", np.full((48, 64), 100 + k, np.uint8))
    sequence = open_sequence(tmp_path / "p", settings=STEREO)
    assert values(sequence) == [(0, 100), (2, 102)]
    assert sequence.timestamp_text(1) == "1403636579.100000000"


def test_numbers_decide_before_the_order(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = write(tmp_path / "p", "left/a%03d.png", "right/b%03d.png", right_from=1)
    sequence = open_sequence(folder, settings=STEREO)
    assert values(sequence) == [(k, 100 + k - 1) for k in range(1, N)]
    assert "2 images have no partner" in caplog.text


def test_time_file_and_rate(tmp_path: Path) -> None:
    folder = write(tmp_path / "p", "left/%d.png", "right/%d.png", 2)
    (tmp_path / "t.txt").write_text("10.5\n10.75\n")
    timed = open_input(folder, settings=STEREO, times=tmp_path / "t.txt")
    assert timed.timestamps.tolist() == [10.5, 10.75]  # type: ignore[union-attr]
    fast = open_input(folder, settings=STEREO, fps=4.0)
    assert fast.timestamps.tolist() == [0.0, 0.25]  # type: ignore[union-attr]
    assert fast.settings.camera.fps == 4.0


def test_a_raw_pair_is_rectified(tmp_path: Path) -> None:
    euroc = builtin_settings("euroc", Sensor.STEREO)
    left = np.tile(np.arange(752, dtype=np.uint8), (480, 1))
    save(tmp_path / "p" / "left.png", left)
    save(tmp_path / "p" / "right.png", left)
    images = open_sequence(tmp_path / "p", settings=euroc).load(0)
    assert images.image.shape == (480, 752)
    assert not np.array_equal(images.image, left)
    assert not np.array_equal(images.image, images.right)


@pytest.mark.parametrize(
    ("left", "right"), [("run1/%d.png", "run2/%d.png"), ("0/%d.png", "1/%d.png")]
)
def test_numbered_folders_are_two_cameras_only_if_stereo_is_asked_for(
    tmp_path: Path, left: str, right: str
) -> None:
    folder = write(tmp_path / "p", left, right)
    with pytest.raises(DatasetError, match="did you mean"):
        open_input(folder, settings=STEREO)
    assert values(open_input(folder, "stereo", settings=STEREO)) == PAIRS


@pytest.mark.parametrize("name", ["%d.png", "img_1_%04d.png", "clip2_%04d.png", "frame%06d.png"])
def test_one_series_stays_one(tmp_path: Path, name: str) -> None:
    for k in range(6):
        save(tmp_path / "p" / (name % k), image(k))
    sequence = open_input(tmp_path / "p", settings=MONO)
    assert len(sequence) == 6  # type: ignore[arg-type]
    assert sequence.sensor is Sensor.MONOCULAR


@pytest.mark.parametrize("stems", [["1.0", "1.5", "2.0", "2.5"], ["turn_left", "b", "c", "d"]])
def test_other_names_are_no_series(stems: list[str]) -> None:
    assert find_series([Path(f"{stem}.png") for stem in stems]) is None


@pytest.mark.parametrize(
    ("left", "right", "side"),
    [
        ("left", "right", 0),
        ("cameraLeft", "cameraRight", 0),
        ("image_02", "image_03", 4),
        ("infra1", "infra2", 3),
        ("right", "left", None),
        ("a_left", "b_right", None),
        ("0000", "0001", None),
    ],
)
def test_names_of_a_pair(left: str, right: str, side: int | None) -> None:
    assert side_of_pair(left, right) == side


def test_depth_goes_before_a_pair_unless_stereo_is_asked_for(tmp_path: Path) -> None:
    folder = write(tmp_path / "p", "infra1/%d.png", "infra2/%d.png")
    for k in range(N):
        save(folder / "color" / f"{k}.png", image(k, (48, 64, 3)))
        save(folder / "depth" / f"{k}.png", np.full((48, 64), 1000, np.uint16))
    rgbd = builtin_settings("tum3", Sensor.RGBD)
    assert open_input(folder, settings=rgbd).sensor is Sensor.RGBD
    assert values(open_input(folder, "stereo", settings=STEREO)) == PAIRS


def test_the_clearest_pair_of_several(tmp_path: Path) -> None:
    folder = write(tmp_path / "p", "image_0/%d.png", "image_1/%d.png")
    write(folder, "image_2/%d.png", "image_3/%d.png", 2)
    assert values(open_sequence(folder, settings=STEREO)) == PAIRS


# ---- side by side --------------------------------------------------------------------------------
def half_size() -> tuple[Settings, Settings]:
    camera = replace(STEREO.camera, width=64, height=48)
    mono = settings_for_camera(replace(camera, bf=0.0), Sensor.MONOCULAR)
    return replace(STEREO, camera=camera), mono


@pytest.fixture
def wide(tmp_path: Path) -> Path:
    """Images with the left view (grey value k) and the right one (100 + k) side by side."""
    for k in range(N):
        both = np.full((48, 128), k, np.uint8)
        both[:, 64:] = 100 + k
        save(tmp_path / "wide" / f"{k}.png", both)
    return tmp_path / "wide"


def test_halves_are_a_pair(wide: Path) -> None:
    stereo, mono = half_size()
    sequence = open_input(wide, settings=stereo, split=True)
    assert sequence.sensor is Sensor.STEREO
    assert sequence.load(0).image.shape == (48, 64)  # type: ignore[union-attr]
    assert values(sequence) == PAIRS
    alone = open_input(wide, "mono", settings=mono, split=True).load(3)  # type: ignore[union-attr]
    assert (alone.image == 3).all()
    assert alone.image.shape == (48, 64)
    assert alone.right is None


def test_images_twice_as_wide_are_refused(wide: Path) -> None:
    with pytest.raises(DatasetError, match=r"128 x 48 pixels, twice as wide .* take --split"):
        open_input(wide, "mono", settings=half_size()[1])


def test_odd_widths_have_no_halves(tmp_path: Path) -> None:
    save(tmp_path / "p" / "0.png", np.zeros((48, 127), np.uint8))
    sequence = open_input(tmp_path / "p", settings=STEREO, split=True)
    with pytest.raises(ImageError, match="127 pixels wide"):
        sequence.load(0)  # type: ignore[union-attr]
