# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of other programs become settings for every sensor; KITTI's files."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py import Sensor, SettingsError
from orbslam2py.calibration import CameraFileFormat, read_camera_file
from orbslam2py.settings import DepthSettings
from support.camera_files import FX, KALIBR, KALIBR_PAIR, KITTI, OPENCV, ROS, D, written


@pytest.mark.parametrize("text", [OPENCV, KALIBR, KALIBR_PAIR, ROS])
def test_every_file_gives_an_rgbd_camera(tmp_path: Path, text: str) -> None:
    settings = read_camera_file(written(tmp_path, text), sensor="rgbd", depth_factor=5000)
    assert settings.sensor is Sensor.RGBD
    assert settings.camera.fx == FX
    assert settings.camera.k1 == D[0]
    assert settings.depth == DepthSettings(40.0, 5000.0)
    assert settings.baseline == pytest.approx(0.075)


def test_one_of_a_pair(tmp_path: Path) -> None:
    path = written(tmp_path, KALIBR_PAIR)
    mono = read_camera_file(path, sensor=Sensor.MONOCULAR)
    assert (mono.sensor, mono.camera.fx, mono.rectification) == (Sensor.MONOCULAR, FX, None)
    assert read_camera_file(path, sensor="stereo") == read_camera_file(path)


def test_rectified_camera_becomes_a_pair_by_its_baseline(tmp_path: Path) -> None:
    path = written(tmp_path, "1 PINHOLE 640 480 500 510 320 240\n")
    settings = read_camera_file(path, sensor="stereo", baseline=0.2)
    assert settings.camera.bf == pytest.approx(100)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (OPENCV, {"sensor": "stereo", "baseline": 0.1}, "must be rectified"),
        (KALIBR_PAIR, {"sensor": "stereo", "baseline": 0.1}, "contains the baseline, 0.11 m"),
        (KALIBR_PAIR, {"depth_factor": 1000}, "leave it out for stereo"),
        (KALIBR, {"depth_factor": 1000}, "leave it out for mono"),
        (ROS, {"sensor": "rgbd", "right": "right.yaml"}, "leave --right out for rgbd"),
        (KITTI, {"camera": 4}, "has no P4; give --camera with one there is: P0, P1, P2, P3"),
        (
            KITTI,
            {"camera": 3, "sensor": "stereo"},
            "no right camera for P3.*one of --camera 0",
        ),
        (KITTI, {"camera": 1, "sensor": "stereo"}, "P2 does not stand to the right of P1"),
        (KITTI.replace("P0: 700", "P0: x"), {}, "P0 must hold 12 finite numbers"),
        (KITTI.replace("P0: 700 ", "P0: "), {}, "P0 must hold 12 finite numbers"),
        (KITTI.replace("P0: 700", "P0: -7"), {}, "yaml: P0 has the focal lengths -7, 700"),
        (OPENCV.replace("[ 520.5", "[ 0"), {}, "yaml: the camera matrix has the focal lengths 0,"),
        (ROS.replace("[520.5", "[-5"), {}, "yaml: the camera matrix has the focal lengths -5,"),
        ("1 PINHOLE 640 480 0 510 320 240\n", {}, ":1: PINHOLE has the focal lengths 0, 510"),
        (KALIBR.replace("[520.5", "[-5"), {}, "yaml: cam0.intrinsics has the focal lengths -5,"),
        (
            KALIBR_PAIR.replace("[640, 480]", "[320, 240]"),
            {},
            r"yaml: cam0 has its centre at 325.75, 236.125, outside of its images of 320 x 240 "
            "pixels; give the intrinsics and the size of the same images",
        ),
        (
            KALIBR_PAIR.replace("0.0, -0.11", "0.0, 0.0"),
            {},
            r"yaml: the pair cannot be rectified, because cam0 and cam1 have the same position.*"
            r"check T_cn_cnm1, or take one of them with --camera 0",
        ),
    ],
)
def test_what_does_not_fit(
    tmp_path: Path, text: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(SettingsError, match=message):
        read_camera_file(written(tmp_path, text), **options)  # type: ignore[arg-type]


# ---- KITTI ---------------------------------------------------------------------------------------
def test_kitti_is_a_pair(tmp_path: Path) -> None:
    settings = read_camera_file(written(tmp_path, KITTI, "calib.txt"))
    assert settings.sensor is Sensor.STEREO
    assert settings.baseline == pytest.approx(0.5)
    assert (settings.camera.fps, settings.orb.n_features) == (10, 2000)
    assert settings.rectification is None


def test_colour_pair_of_kitti(tmp_path: Path) -> None:
    path = written(tmp_path, KITTI, "calib.txt")
    settings = read_camera_file(path, camera=2, sensor="stereo", fps=20, n_features=1500)
    assert settings.baseline == pytest.approx(0.4)
    assert (settings.camera.fx, settings.camera.fps) == (710, 20)
    assert settings.orb.n_features == 1500


def test_one_camera_of_kitti(tmp_path: Path) -> None:
    path = written(tmp_path, KITTI, "calib.txt")
    for options in ({"camera": 0}, {"sensor": "mono"}, {"sensor": "rgbd"}):
        settings = read_camera_file(path, **options)  # type: ignore[arg-type]
        assert settings.sensor is Sensor(options.get("sensor", "mono"))
        assert settings.camera.fx == 700


def test_raw_drive_of_kitti(tmp_path: Path) -> None:
    text = "calib_time: 09-Jan-2012 13:57:47\n"
    for i, tx in enumerate((0, -350)):
        text += f"S_0{i}: 1392 512\nD_0{i}: -0.37 0.2 0 0 -0.07\nS_rect_0{i}: 1242 375\n"
        text += f"P_rect_0{i}: 700 0 600 {tx} 0 700 180 0 0 0 1 0\n"
    settings = read_camera_file(written(tmp_path, text, "calib_cam_to_cam.txt"))
    assert settings.baseline == pytest.approx(0.5)
    assert (settings.camera.width, settings.camera.height) == (1242, 375)


def test_a_list_without_cameras(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no projection matrix P0"):
        read_camera_file(written(tmp_path, "hello\n"), CameraFileFormat.KITTI)
