# SPDX-License-Identifier: BSD-3-Clause
"""Drives of KITTI raw as they are unpacked: synchronised and rectified, and raw ones."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, open_sequence
from orbslam2py.datasets import KittiRawSequence, Layout, open_input, recognise
from orbslam2py.trajectory.rotations import inverse_poses
from support.small_folders import save

N = 4
RAW, RECTIFIED = (72, 52), (64, 48)  # width, height
TURN = np.deg2rad(2.0)
#: Rectifying rotations: the right camera stands turned by 2 degrees.
R_RIGHT = [np.cos(TURN), 0, -np.sin(TURN), 0, 1, 0, np.sin(TURN), 0, np.cos(TURN)]
FIRST_SECOND = 1317042145  # 2011-09-26 13:02:25, the clock of the car taken as UTC


def numbers(values: object) -> str:
    return " ".join(f"{value:.9e}" for value in np.ravel(values))  # type: ignore[call-overload]


def calibration() -> str:
    lines = ["calib_time: 09-Jan-2012 13:57:47", "corner_dist: 9.950000e-02"]
    eye = np.eye(3)
    for camera, offset in enumerate((0.0, -20.0, 2.0, -18.0)):
        R = R_RIGHT if camera == 1 else eye
        K = [50, 0, 36, 0, 51, 26, 0, 0, 1]
        P = [40, 0, 32, offset, 0, 40, 24, 0, 0, 0, 1, 0]
        values = {
            "S": RAW,
            "K": K,
            "D": [-0.3, 0.1, 0.001, -0.002, 0.01],
            "R": eye,
            "T": [-0.5 * camera, 0, 0],
            "S_rect": RECTIFIED,
            "R_rect": R,
            "P_rect": P,
        }
        lines += [f"{name}_{camera:02d}: {numbers(value)}" for name, value in values.items()]
    return "\n".join(lines) + "\n"


def write_drive(day: Path, kind: str = "sync", cameras: tuple[int, ...] = (0, 1)) -> Path:
    """A drive of four frames, a tenth of a second apart, with images of grey value 10 c + k."""
    drive = day / f"{day.name}_drive_0001_{kind}"
    size = RAW if kind == "extract" else RECTIFIED
    for camera in cameras:
        folder = drive / f"image_{camera:02d}"
        for k in range(N):
            pixels = np.full(size[::-1], 10 * camera + k, np.uint8)
            save(folder / "data" / f"{k:010d}.png", pixels)
        late = 1000 * camera  # nanoseconds
        dates = [f"2011-09-26 13:02:25.{100_000_000 * k + late:09d}\n" for k in range(N)]
        (folder / "timestamps.txt").write_text("".join(dates))
    (day / "calib_cam_to_cam.txt").write_text(calibration())
    return drive


@pytest.fixture
def day(tmp_path: Path) -> Path:
    return tmp_path / "2011_09_26"


def test_a_synchronised_drive(day: Path) -> None:
    drive = write_drive(day)
    assert recognise(drive) is Layout.KITTI_RAW
    sequence = open_sequence(drive)
    assert sequence.sensor is Sensor.STEREO
    assert [sequence.timestamp_text(i) for i in range(N)] == [
        f"{FIRST_SECOND}.{k}00000000" for k in range(N)
    ]
    assert sequence.timestamps == pytest.approx(FIRST_SECOND + 0.1 * np.arange(N), abs=1e-6)
    camera = sequence.settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (40, 40, 32, 24)
    assert camera.bf == 20
    assert (camera.width, camera.height, camera.fps) == (*RECTIFIED, 10)
    assert (camera.k1, sequence.settings.rectification) == (0, None)
    images = sequence.load(2)
    assert images.right is not None
    assert ((images.image == 2).all(), (images.right == 12).all()) == (True, True)


def test_the_colour_pair(day: Path) -> None:
    sequence = open_input(write_drive(day, cameras=(2, 3)))
    assert sequence.settings.camera.bf == 20
    images = sequence.load(1)  # type: ignore[union-attr]
    assert images.right is not None
    assert (int(images.image[0, 0]), int(images.right[0, 0])) == (21, 31)


@pytest.mark.parametrize(
    ("kind", "cameras", "sensor", "images", "of"),
    [
        (
            *("sync", (0, 1, 2, 3), "stereo", "4 frames of the grey cameras image_00 and image_01"),
            "rectified",
        ),
        (
            *("extract", (2, 3), "stereo", "4 frames of the colour cameras image_02 and image_03"),
            "raw",
        ),
        (
            *("sync", (2, 3), "mono", "4 frames of the colour camera image_02"),
            "rectified",
        ),
    ],
)
def test_the_log_names_cameras_and_calibration(
    day: Path,
    caplog: pytest.LogCaptureFixture,
    kind: str,
    cameras: tuple[int, ...],
    sensor: str,
    images: str,
    of: str,
) -> None:
    drive = write_drive(day, kind, cameras)
    with caplog.at_level("INFO"):
        sequence = open_sequence(drive, sensor)
        assert sequence.settings.sensor is Sensor(sensor)
    path = day / "calib_cam_to_cam.txt"
    assert caplog.messages == [f"{drive}: {images}; calibration: {path} (for {of} images)"]


def test_the_log_names_no_calibration_that_is_not_used(
    day: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = write_drive(day)
    with caplog.at_level("INFO"):
        sequence = open_sequence(drive, settings="kitti00-02")
        assert sequence.settings.camera.width == 1241
        assert sequence.default_settings().camera.width == 64
    (message,) = (one for one in caplog.messages if "frames of the" in one)
    assert message.endswith("image_00 and image_01; calibration: the given settings")


def test_half_a_pair_is_a_single_camera(day: Path) -> None:
    drive = write_drive(day, cameras=(0,))
    assert open_sequence(drive).sensor is Sensor.MONOCULAR
    with pytest.raises(DatasetError, match="has no stereo images; it can be used as: mono"):
        open_sequence(drive, "stereo")


def test_grey_left_alone_gives_way_to_a_whole_colour_pair(day: Path) -> None:
    sequence = open_sequence(write_drive(day, cameras=(0, 2, 3)))
    assert int(sequence.load(0).image[0, 0]) == 20


def test_a_raw_drive_is_rectified(day: Path) -> None:
    sequence = open_sequence(write_drive(day, "extract"))
    settings = sequence.settings
    assert settings.rectification is not None
    left, right = settings.rectification.left, settings.rectification.right
    assert np.array_equal(left.K, [[50, 0, 36], [0, 51, 26], [0, 0, 1]])
    assert pytest.approx([-0.3, 0.1, 0.001, -0.002, 0.01]) == left.D
    assert pytest.approx(np.reshape(R_RIGHT, (3, 3)), abs=1e-8) == right.R
    assert (left.P[0, 3], right.P[0, 3]) == (0, -20)
    assert (settings.camera.fx, settings.camera.bf) == (40, 20)
    images = sequence.load(0)
    assert images.image.shape == RAW[::-1]
    assert int(images.right[26, 36]) == 10  # type: ignore[index]


def test_a_raw_camera_alone_keeps_its_distortion(day: Path) -> None:
    camera = open_sequence(write_drive(day, "extract"), "mono").settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (50, 51, 36, 26)
    assert (camera.k1, camera.k2, camera.p1, camera.p2, camera.k3) == (
        *(-0.3, 0.1, 0.001, -0.002, 0.01),
    )
    assert (camera.width, camera.height) == RAW


def test_the_size_of_the_images_counts_more_than_the_name(day: Path) -> None:
    drive = write_drive(day, "extract")
    renamed = drive.rename(day / "drive")
    assert open_sequence(renamed).settings.rectification is not None
    shutil.rmtree(renamed)
    plain = write_drive(day).rename(day / "my_extract")
    assert open_sequence(plain).settings.rectification is None


def test_a_right_camera_with_fewer_images(day: Path, caplog: pytest.LogCaptureFixture) -> None:
    drive = write_drive(day)
    (drive / "image_01" / "data" / f"{1:010d}.png").unlink()
    sequence = open_sequence(drive)
    assert [int(sequence.load(i).right[0, 0]) for i in range(3)] == [10, 12, 13]  # type: ignore[index]
    assert [int(sequence.load(i).image[0, 0]) for i in range(3)] == [0, 2, 3]
    assert "1 left images have no right one" in caplog.text


def test_ground_truth(day: Path) -> None:
    """The car drives north by a thousandth of a degree a frame, turned by 90 degrees from east."""
    drive = write_drive(day)
    latitude = 49.0 + 1e-3 * np.arange(N)
    for k in range(N):
        path = drive / "oxts" / "data" / f"{k:010d}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        packet = [latitude[k], 8.4, 116.0, 0.0, 0.0, np.pi / 2, *np.zeros(24)]
        path.write_text(" ".join(map(repr, map(float, packet))) + "\n")
    shutil.copy(drive / "image_00" / "timestamps.txt", drive / "oxts" / "timestamps.txt")
    assert open_sequence(drive).ground_truth() is None, "nothing tells where the camera is"
    eye = numbers(np.eye(3))
    (day / "calib_imu_to_velo.txt").write_text(f"calib_time: x\nR: {eye}\nT: -0.8 0.3 -0.8\n")
    to_camera = [0, -1, 0, 0, 0, -1, 1, 0, 0]  # x right, y down, z forward
    (day / "calib_velo_to_cam.txt").write_text(f"R: {numbers(to_camera)}\nT: 0 -0.1 -0.3\n")
    truth = open_sequence(drive).ground_truth()
    assert truth is not None
    assert truth.timestamps[1] - truth.timestamps[0] == pytest.approx(0.1, abs=1e-6)
    moved = truth.T_wc[:, :3, 3] - truth.T_wc[0, :3, 3]
    # A degree of latitude is 111.32 km on the sphere of 6378.137 km.
    assert moved[:, 0] == pytest.approx(np.zeros(N), abs=1e-6)
    assert moved[:, 1] == pytest.approx(111.3195 * np.arange(N), rel=1e-4)
    in_camera = inverse_poses(truth.T_wc) @ np.array([0, 0, 0, 1.0])
    # IMU to Velodyne to camera, written out by hand.
    assert in_camera[0, :3] == pytest.approx([-0.3, 0.8 - 0.1, -0.8 - 0.3], abs=1e-9)
    assert truth.T_wc[0, :3, 2] == pytest.approx([0, 1, 0], abs=1e-9), "it looks north"
    assert truth.T_wc[0, :3, 1] == pytest.approx([0, 0, -1], abs=1e-9), "its y points down"


# ---- wrong ones ----------------------------------------------------------------------------------
def test_a_missing_calibration(day: Path) -> None:
    drive = write_drive(day)
    (day / "calib_cam_to_cam.txt").unlink()
    with pytest.raises(DatasetError) as caught:
        _ = open_sequence(drive).settings
    for part in ("calib_cam_to_cam.txt is missing", "2011_09_26_calib.zip", f"into {day}"):
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("P_rect_01:", "Q:", r"calib_cam_to_cam.txt has no line 'P_rect_01:'"),
        ("S_rect_00: ", "S_rect_00: 7 ", "S_rect_00 has 3 numbers instead of 2"),
        ("P_rect_00: 4", "P_rect_00: x", r"calib_cam_to_cam.txt:\d+"),
        (" -2.000000000e+01", " 20", "P_rect_01 does not stand to the right"),
    ],
)
def test_a_spoilt_calibration(day: Path, old: str, new: str, message: str) -> None:
    drive = write_drive(day)
    path = day / "calib_cam_to_cam.txt"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(DatasetError, match=message):
        _ = open_sequence(drive).settings


@pytest.mark.parametrize("line", ["12.5", "2011-09-26", "2011-09-26 25:02:25.0", "NaT NaT", "a b"])
def test_lines_that_are_no_dates(day: Path, line: str) -> None:
    drive = write_drive(day)
    path = drive / "image_00" / "timestamps.txt"
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(DatasetError, match=rf"timestamps.txt:5: '{line}' is no date and time"):
        KittiRawSequence(drive)


def test_too_few_times(day: Path) -> None:
    drive = write_drive(day)
    path = drive / "image_00" / "timestamps.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:2]) + "\n")
    with pytest.raises(DatasetError, match=r"holds 2 time stamps, but .* up to 0000000003"):
        KittiRawSequence(drive)


def test_no_times(day: Path) -> None:
    drive = write_drive(day)
    (drive / "image_00" / "timestamps.txt").unlink()
    with pytest.raises(DatasetError, match=r"image_00/timestamps.txt"):
        KittiRawSequence(drive)


def test_a_spoilt_packet(day: Path) -> None:
    drive = write_drive(day)
    for name in ("calib_imu_to_velo.txt", "calib_velo_to_cam.txt"):
        (day / name).write_text(f"R: {numbers(np.eye(3))}\nT: 0 0 0\n")
    (drive / "oxts" / "data").mkdir(parents=True)
    shutil.copy(drive / "image_00" / "timestamps.txt", drive / "oxts" / "timestamps.txt")
    (drive / "oxts" / "data" / "0000000000.txt").write_text("49.0 8.4\n")
    with pytest.raises(DatasetError, match=r"0000000000.txt does not begin with latitude"):
        open_sequence(drive).ground_truth()


def test_the_folder_of_the_day_names_the_drive(day: Path) -> None:
    drive = write_drive(day)
    with pytest.raises(DatasetError, match=rf"did you mean {drive}"):
        open_input(day)
