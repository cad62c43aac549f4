# SPDX-License-Identifier: BSD-3-Clause
"""KITTI odometry sequences: small made-up folders, good and bad."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor
from orbslam2py.datasets import Layout, Sequence, open_sequence
from orbslam2py.settings import builtin_settings
from support.small_folders import P0, P1, SIZE, image, save


def poses_text(n: int) -> str:
    return "".join(f"1 0 0 {k} 0 1 0 0 0 0 1 {2 * k}\n" for k in range(n))


def test_kitti_stereo(kitti: Path) -> None:
    sequence: Sequence = open_sequence(kitti)
    assert sequence.layout is Layout.KITTI
    assert sequence.sensor is Sensor.STEREO
    assert len(sequence) == 3
    assert sequence.timestamp_text(1) == "1.036224e-01"
    images = sequence.load(2)
    np.testing.assert_array_equal(images.image, image(2))
    np.testing.assert_array_equal(images.right, image(12))
    settings = sequence.settings
    camera = settings.camera
    assert (camera.fx, camera.cx, camera.cy, camera.bf) == (700, 600, 180, 350)
    assert camera.fps == pytest.approx(9.651, abs=1e-3)
    assert settings.close_depth == 20.0
    assert (settings.orb.n_features, settings.orb.ini_th_fast, settings.orb.min_th_fast) == (
        2000,
        20,
        7,
    )


def test_kitti_left_camera_only(kitti: Path) -> None:
    shutil.rmtree(kitti / "image_1")
    (kitti / "calib.txt").write_text(P0 + "\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    sequence = open_sequence(kitti)
    assert sequence.sensor is Sensor.MONOCULAR
    assert sequence.load(0).right is None
    assert sequence.settings.camera.bf == 0.0
    with pytest.raises(DatasetError, match="no stereo images"):
        open_sequence(kitti, Sensor.STEREO)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (P1, "no line 'P0:'"),
        (P0, "no line 'P1:'"),
        (f"{P0} 5\n{P1}", "calib.txt:1: P0 has 13 numbers instead of 12"),
        (f"{P0}\n{P1}".replace("-350", "x"), "calib.txt:2: 'x' is not a number"),
        (f"{P0}\n{P1}".replace("-350", "0"), "calib.txt: Camera.bf"),
        (f"{P0}\n{P1}".replace("700", "0"), "calib.txt: Camera.fx"),
    ],
)
def test_kitti_bad_calibration(kitti: Path, text: str, expected: str) -> None:
    (kitti / "calib.txt").write_text(text + "\n")
    with pytest.raises(DatasetError) as caught:
        _ = open_sequence(kitti).settings
    assert expected in str(caught.value)


def test_kitti_without_calibration(kitti: Path) -> None:
    (kitti / "calib.txt").unlink()
    with pytest.raises(DatasetError, match="kitti04-12"):
        _ = open_sequence(kitti).settings
    sequence = open_sequence(kitti, settings="kitti07")
    assert sequence.settings == builtin_settings("kitti04-12", Sensor.STEREO)
    assert len(sequence.load(0).image) == SIZE[0]


def test_kitti_missing_right_image(kitti: Path) -> None:
    (kitti / "image_1" / "000001.png").unlink()
    sequence = open_sequence(kitti)
    with pytest.raises(DatasetError, match=r"image_1/000001\.png"):
        sequence.load(1)
    assert sequence.load(2).right is not None


def test_kitti_index_out_of_range(kitti: Path) -> None:
    for index in (-1, 3):
        with pytest.raises(IndexError):
            open_sequence(kitti).load(index)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("0\nx\n", "times.txt:2: 'x'"), ("0 1\n", "times.txt:1: '0 1' is not a number")],
)
def test_kitti_bad_times(kitti: Path, text: str, expected: str) -> None:
    (kitti / "times.txt").write_text(text)
    with pytest.raises(DatasetError) as caught:
        open_sequence(kitti)
    assert expected in str(caught.value)


@pytest.mark.parametrize("camera", [0, 1])
def test_kitti_images_without_a_time(kitti: Path, camera: int) -> None:
    """They were left out silently; the list may be that of another sequence."""
    folder = kitti / f"image_{camera}"
    save(folder / "000003.png", image(3))
    save(folder / "000004.jpg", image(4))
    with pytest.raises(DatasetError) as caught:
        open_sequence(kitti)
    assert str(caught.value) == (
        f"{kitti / 'times.txt'} holds 3 time stamps, but there are 5 images in {folder}, up to "
        "000004; copy the sequence's own times.txt there, or take the images from 000003 on away"
    )


def test_kitti_images_of_a_camera_that_is_not_used_need_no_times(kitti: Path) -> None:
    save(kitti / "image_1" / "000003.png", image(3))
    assert len(open_sequence(kitti, Sensor.MONOCULAR)) == 3


def test_kitti_other_files_among_the_images_need_no_times(kitti: Path) -> None:
    for name in ("0000000009.png", "cover.png", "000009.txt"):
        (kitti / "image_0" / name).write_bytes(b"")
    assert len(open_sequence(kitti)) == 3


def test_kitti_times_without_images_are_told_at_once(
    kitti: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A part of the images was copied: those that are there have their times."""
    times = kitti / "times.txt"
    times.write_text(times.read_text() + "3.1e-01\n4.1e-01\n")
    assert len(open_sequence(kitti)) == 5
    (said,) = [record.getMessage() for record in caplog.records]
    assert said == (
        f"{times} holds 5 time stamps, but there are 3 images in {kitti / 'image_0'}, up to "
        "000002; the frames after it are skipped: put their images there, or take --max-frames 3"
    )


def test_kitti_with_a_time_for_every_image_is_not_warned_of(
    kitti: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (kitti / "image_0" / "000001.png").unlink()
    assert len(open_sequence(kitti)) == 3
    assert not caplog.records


@pytest.mark.parametrize("place", ["poses.txt", "07.txt", "../../poses/07.txt", "03.txt"])
def test_kitti_ground_truth_is_found(kitti: Path, place: str) -> None:
    assert open_sequence(kitti).ground_truth() is None
    (kitti / place).parent.mkdir(exist_ok=True)
    (kitti / place).write_text(poses_text(3))
    truth = open_sequence(kitti).ground_truth()
    assert truth is not None
    np.testing.assert_allclose(truth.timestamps, [0.0, 0.1036224, 0.2072343])
    np.testing.assert_array_equal(truth.positions[2], [2, 0, 4])


@pytest.mark.parametrize(("n_poses", "n_expected"), [(5, 3), (2, 2)])
def test_kitti_ground_truth_of_another_length(
    kitti: Path, n_poses: int, n_expected: int, caplog: pytest.LogCaptureFixture
) -> None:
    (kitti / "poses.txt").write_text(poses_text(n_poses))
    truth = open_sequence(kitti).ground_truth()
    assert truth is not None
    assert len(truth) == n_expected
    assert f"{n_poses} poses for 3 frames" in caplog.text


def test_kitti_bad_ground_truth(kitti: Path) -> None:
    (kitti / "poses.txt").write_text("1 0 0\n")
    with pytest.raises(DatasetError, match=r"poses\.txt:1: expected 12"):
        open_sequence(kitti).ground_truth()


# ---- colour cameras ------------------------------------------------------------------------------
# The left colour camera is 6 cm to the left of the left grey one, the right one 54 cm beside it.
P2 = "P2: 700 0 600 42 0 700 180 0 0 0 1 0"
P3 = "P3: 700 0 600 -336 0 700 180 0 0 0 1 0"


@pytest.fixture
def colour(kitti: Path) -> Path:
    """As it is downloaded with colour images only."""
    for left, right in ((0, 2), (1, 3)):
        shutil.rmtree(kitti / f"image_{left}")
        for k in range(3):
            save(kitti / f"image_{right}" / f"{k:06d}.png", image(10 * right + k, (*SIZE, 3)))
    (kitti / "calib.txt").write_text(f"{P0}\n{P1}\n{P2}\n{P3}\n")
    return kitti


def test_kitti_with_colour_cameras_only(colour: Path) -> None:
    sequence = open_sequence(colour)
    assert (sequence.layout, sequence.sensor) == (Layout.KITTI, Sensor.STEREO)
    images = sequence.load(2)
    np.testing.assert_array_equal(images.image, image(22, (*SIZE, 3))[..., ::-1])
    np.testing.assert_array_equal(images.right, image(32, (*SIZE, 3))[..., ::-1])
    assert sequence.settings.camera.bf == pytest.approx(378)
    assert sequence.settings.baseline == pytest.approx(0.54)
    assert open_sequence(colour, Sensor.MONOCULAR).settings.camera.fx == 700


def test_kitti_true_poses_are_those_of_the_colour_camera(colour: Path) -> None:
    (colour / "poses.txt").write_text(poses_text(3))
    truth = open_sequence(colour).ground_truth()
    assert truth is not None
    np.testing.assert_allclose(truth.positions[2], [2 - 0.06, 0, 4])
    (colour / "calib.txt").unlink()
    truth = open_sequence(colour).ground_truth()
    assert truth is not None
    np.testing.assert_allclose(truth.positions[2], [2, 0, 4])


def test_kitti_grey_cameras_come_first(colour: Path) -> None:
    save(colour / "image_0" / "000000.png", image(0))
    mono = open_sequence(colour, Sensor.MONOCULAR)
    assert mono.load(0).image.ndim == 2
    stereo = open_sequence(colour)  # of the grey pair only one is there
    assert stereo.sensor is Sensor.STEREO
    assert stereo.load(0).image.ndim == 3


def test_kitti_calibration_without_the_colour_cameras(colour: Path) -> None:
    (colour / "calib.txt").write_text(f"{P0}\n{P1}\n")
    with pytest.raises(DatasetError, match=r"no line 'P2:' \(left colour camera\); copy"):
        _ = open_sequence(colour).settings
    (colour / "calib.txt").write_text(f"{P2}\n")
    with pytest.raises(DatasetError, match=r"no line 'P3:' \(right colour camera\), needed for"):
        _ = open_sequence(colour).settings


def test_kitti_one_colour_camera_with_grey_calibration(
    colour: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (colour / "calib.txt").write_text(f"{P0}\n")
    with caplog.at_level(logging.INFO):
        camera = open_sequence(colour, Sensor.MONOCULAR).settings.camera
    assert (camera.fx, camera.cx, camera.cy) == (700, 600, 180)
    (said,) = [record.getMessage() for record in caplog.records]
    assert "calib.txt has no line 'P2:'; taking P0" in said


@pytest.mark.parametrize(
    ("size", "name", "suggested"),
    [
        ((375, 1242), "anything", "give --settings kitti03 ("),
        ((376, 1241), "05", "give --settings kitti00-02 ("),
        (SIZE, "05", "give --settings kitti04-12 ("),
        (SIZE, "13", "kitti00-02, kitti03 or kitti04-12, by the number"),
        (SIZE, "anything", "kitti00-02, kitti03 or kitti04-12, by the number"),
    ],
)
def test_kitti_without_a_line_suggests_what_is_built_in(
    colour: Path, size: tuple[int, int], name: str, suggested: str
) -> None:
    folder = colour.rename(colour.parent / name)
    save(folder / "image_2" / "000000.png", image(1, size))
    (folder / "calib.txt").write_text(f"{P1}\n")
    for sensor in (Sensor.MONOCULAR, Sensor.STEREO):
        with pytest.raises(DatasetError, match="no line 'P2:'") as refused:
            _ = open_sequence(folder, sensor).settings
        assert suggested in str(refused.value)
