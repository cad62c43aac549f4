# SPDX-License-Identifier: BSD-3-Clause
"""Cameras that other programs have calibrated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.calibration import CameraFileFormat, read_camera_file
from orbslam2py.settings import CameraSettings
from support.camera_files import CX, CY, FX, FY, KALIBR, KALIBR_PAIR, OPENCV, ROS, D, written


@pytest.mark.parametrize("text", [OPENCV, KALIBR, ROS], ids=["opencv", "kalibr", "ros"])
def test_imported_camera_is_the_true_one(tmp_path: Path, text: str) -> None:
    settings = read_camera_file(written(tmp_path, text), fps=20, n_features=1500)
    assert settings.sensor is Sensor.MONOCULAR
    assert settings.camera == CameraSettings(FX, FY, CX, CY, *D, width=640, height=480, fps=20)
    assert settings.orb.n_features == 1500


def test_opencv_xml(tmp_path: Path) -> None:
    path = tmp_path / "camera.xml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("cameraMatrix", np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]]))
    storage.write("distCoeffs", np.array(D))
    storage.release()
    camera = read_camera_file(path).camera
    assert camera == CameraSettings(FX, FY, CX, CY, *D)


def test_whole_numbers_of_opencv(tmp_path: Path) -> None:
    """Whole ones, "0" or "1", stand between others with a point."""
    path = written(tmp_path, OPENCV.replace("0.,", "0,").replace("1. ]", "1 ]"))
    expected = CameraSettings(FX, FY, CX, CY, *D, width=640, height=480)
    assert read_camera_file(path).camera == expected


def test_pair_in_xml_and_json(tmp_path: Path) -> None:
    """As OpenCV writes it, with whole numbers and matrices of several lines."""
    expected = None
    for suffix in ("yaml", "xml", "json"):
        path = tmp_path / f"pair.{suffix}"
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        for side in "12":
            storage.write(f"M{side}", np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]]))
            storage.write(f"D{side}", np.array([D]))
        storage.write("R", np.eye(3))
        storage.write("T", np.array([[-0.11], [0.0], [0.0]]))
        storage.write("image_width", 640)
        storage.write("image_height", 480)
        storage.release()
        settings = read_camera_file(path)
        assert settings.baseline == pytest.approx(0.11)
        assert settings == (expected or settings)
        expected = settings


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("SIMPLE_PINHOLE 640 480 500 320 240", (500, 500, 319.5, 239.5)),
        ("PINHOLE 640 480 500 510 320 240", (500, 510, 319.5, 239.5)),
        ("SIMPLE_RADIAL 640 480 500 320 240 0.1", (500, 500, 319.5, 239.5, 0.1)),
        ("RADIAL 640 480 500 320 240 0.1 0.2", (500, 500, 319.5, 239.5, 0.1, 0.2)),
        (
            "OPENCV 640 480 500 510 320 240 0.1 0.2 0.01 0.02",
            (500, 510, 319.5, 239.5, 0.1, 0.2, 0.01, 0.02),
        ),
    ],
)
def test_colmap(tmp_path: Path, line: str, expected: tuple[float, ...]) -> None:
    path = written(tmp_path, f"# Camera list\n3 {line}\n", "cameras.txt")
    assert read_camera_file(path).camera == CameraSettings(*expected, width=640, height=480)
    assert read_camera_file(path, camera=3).camera.fx == 500
    with pytest.raises(SettingsError, match="no camera 1; give --camera with one there is: 3"):
        read_camera_file(path, camera=1)


def test_kalibr_pair(tmp_path: Path) -> None:
    path = written(tmp_path, KALIBR_PAIR)
    settings = read_camera_file(path)
    assert settings.sensor is Sensor.STEREO
    assert settings.baseline == pytest.approx(0.11)
    assert settings.rectification is not None
    np.testing.assert_allclose(settings.rectification.right.K[0, 0], FX)
    settings.save(tmp_path / "pair.yaml")
    assert Settings.load(tmp_path / "pair.yaml", Sensor.STEREO) == settings
    assert read_camera_file(path, camera=1).sensor is Sensor.MONOCULAR
    exchanged = written(tmp_path, KALIBR_PAIR.replace("-0.11", "0.11"))
    with pytest.raises(SettingsError, match="cam1 does not stand to the right of cam0"):
        read_camera_file(exchanged)
    assert read_camera_file(exchanged, camera=1, sensor="stereo") == settings


def test_ros_pair(tmp_path: Path) -> None:
    left = written(tmp_path, ROS, "left.yaml")
    right = written(tmp_path, ROS.replace("320, 0, 0", "320, -60, 0"), "right.yaml")
    settings = read_camera_file(left, right=right)
    assert settings.sensor is Sensor.STEREO
    assert settings.camera.bf == 60
    assert settings.baseline == pytest.approx(0.12)
    assert (settings.camera.fx, settings.camera.cx) == (500, 320)
    with pytest.raises(SettingsError, match="to the right of the first"):
        read_camera_file(left, right=left)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (KALIBR.replace("pinhole", "omni"), r"cam0\.intrinsics must hold 5 finite numbers"),
        (KALIBR.replace("radtan", "lens9"), r"cam0.distortion_model lens9 is not known"),
        (ROS.replace("plumb_bob", "equirectangular"), r"ROS: its camera is a panorama .*not supp"),
        ("1 LENS 640 480 1 2 3\n", r"camera model LENS is not known; undistort"),
        ("1 PINHOLE 640 480 1 2 3\n", "parameters of PINHOLE must hold 4"),
        ("1 PINHOLE 9 9 1 1 1 1\n2 PINHOLE 9 9 1 1 1 1\n", r"lists 2 cameras \(1, 2\)"),
        (KALIBR.replace("intrinsics", "other"), r"cam0\.intrinsics is missing"),
        (KALIBR.replace(str(FX), "x"), "must hold 4 finite numbers"),
        (ROS.replace("data: [520.5", "data: [520.5, 1"), "must hold 9 finite numbers"),
        (OPENCV.replace("camera_matrix", "matrix_of_camera"), "has no camera matrix"),
        (OPENCV.replace(f"[ {FX}, 0.,", f"[ {FX}, 5.,"), "skew"),
        (
            OPENCV.replace(f"[ {FX}, 0.,", f"[ {FX},"),
            r"camera_matrix has 8 numbers, .* 3 x 3",
        ),
        ("cam0: [\n", "is no YAML"),
        ("hello\n", "no camera file we know"),
    ],
)
def test_bad_camera_files(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        read_camera_file(written(tmp_path, text))


def test_options_that_do_not_fit_the_format(tmp_path: Path) -> None:
    path = written(tmp_path, OPENCV)
    with pytest.raises(SettingsError, match="holds one camera"):
        read_camera_file(path, camera=0)
    with pytest.raises(SettingsError, match="goes with ros"):
        read_camera_file(path, right=path)
    with pytest.raises(SettingsError, match="cannot open"):
        read_camera_file(tmp_path / "none.yaml", CameraFileFormat.ROS)


@pytest.mark.parametrize(
    ("name", "text"), [("opencv", OPENCV), ("kalibr", KALIBR), ("ros", ROS), ("auto", KALIBR)]
)
def test_formats_are_named_by_text(tmp_path: Path, name: str, text: str) -> None:
    path = written(tmp_path, text)
    assert read_camera_file(path, name) == read_camera_file(path)


@pytest.mark.parametrize("name", ["xyz", "", None, 3])
def test_a_format_that_there_is_not_is_refused(tmp_path: Path, name: Any) -> None:
    with pytest.raises(SettingsError, match=r"format of the calibration file is .*; give one of"):
        read_camera_file(written(tmp_path, ROS), name)
