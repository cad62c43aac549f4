# SPDX-License-Identifier: BSD-3-Clause
"""Calibrations of WoodScape, Project Aria and RealSense cameras."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import CameraSettings, Sensor, SettingsError
from orbslam2py.calibration import read_camera_file
from orbslam2py.calibration.readers.fitted import fisheye624
from support.lens_files import ARIA, ARIA_LENS, REALSENSE, WOODSCAPE


def written(tmp_path: Path, content: dict[str, Any] | str) -> Path:
    path = tmp_path / "file"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def shown(camera: CameraSettings, angle: float) -> np.ndarray:
    """Pixel of a ray to the right, some degrees from the axis."""
    ray = [[np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))]]
    assert camera.width is not None
    assert camera.height is not None
    return camera.camera_model(camera.width, camera.height).project(ray)[0]


def test_woodscape_is_fitted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        camera = read_camera_file(written(tmp_path, WOODSCAPE)).camera
    assert camera.is_fisheye
    for degrees in (10, 45, 80, 94):
        angle = np.radians(degrees)
        radius = 340 * angle - 32 * angle**2 + 48 * angle**3 - 7.2 * angle**4
        expected = (4 + 640 - 0.5 + radius, -3 + 483 - 0.5)
        np.testing.assert_allclose(shown(camera, degrees), expected, atol=1.0)
    assert "the lens of FV is fitted by" in caplog.text
    assert "degrees from the axis" in caplog.text


def test_aria_is_fitted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        camera = read_camera_file(written(tmp_path, ARIA), size=(512, 512)).camera
    assert camera.is_fisheye
    project = fisheye624((245.0, 245.0, 254.0, 259.0), np.array(ARIA_LENS))
    for degrees in (10, 40, 60):
        angle = np.radians(degrees)
        expected = project(np.array([[np.sin(angle), 0, np.cos(angle)]]))[0]
        np.testing.assert_allclose(shown(camera, degrees), expected, atol=1.0)
    # The published formula, on the axis and beside it.
    np.testing.assert_allclose(project(np.array([[1e-9, 0, 1.0]]))[0], (254, 259), atol=1e-5)
    assert "camera-slam-left is fitted by" in caplog.text


def test_wrong_files_of_aria_and_woodscape(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"does not contain the size .* give it with --size"):
        read_camera_file(written(tmp_path, ARIA))
    wild = json.loads(json.dumps(WOODSCAPE))
    del wild["intrinsic"]["k3"]
    with pytest.raises(SettingsError, match=r"intrinsic\.k3 is missing; add it"):
        read_camera_file(written(tmp_path, wild))
    wild["intrinsic"]["k3"] = 0.0
    wild["intrinsic"]["cx_offset"] = 5000.0
    with pytest.raises(SettingsError, match="shows next to nothing in images of 1280 x 966"):
        read_camera_file(written(tmp_path, wild))
    other = json.loads(json.dumps(ARIA))
    other["CameraCalibrations"][0]["Projection"]["Name"] = "Spherical"
    with pytest.raises(SettingsError, match="Name is Spherical; allowed: FisheyeRadTanThinPrism"):
        read_camera_file(written(tmp_path, other), size=(512, 512))
    # The prism bends it by more than any of our models can.
    bent = json.loads(json.dumps(ARIA))
    bent["CameraCalibrations"][0]["Projection"]["Params"][-4:] = [0.2, 0.0, -0.2, 0.1]
    with pytest.raises(SettingsError, match=r"none of our models fits .*orbslam2py calibrate"):
        read_camera_file(written(tmp_path, bent), size=(512, 512))


def test_realsense_pair_and_single_cameras(tmp_path: Path) -> None:
    path = written(tmp_path, REALSENSE)
    pair = read_camera_file(path, size=(848, 480))
    assert pair.sensor is Sensor.STEREO
    assert pair.baseline == pytest.approx(0.05)
    single = read_camera_file(path, size=(848, 480), camera=0, sensor="mono").camera
    assert (single.fx, single.fy, single.cx, single.cy) == (425.75, 425.5, 424.125, 240.5)
    fisheye = read_camera_file(path, size=(848, 800)).camera
    assert fisheye.model == "kannala_brandt"
    assert fisheye.lens == (-0.00676, 0.04517, -0.04351, 0.00837)
    colour = read_camera_file(path, size=(640, 480), sensor="rgbd").camera
    # Inverse Brown-Conrady leads from distorted to undistorted points.
    x, y = 0.35, -0.2
    r2 = x * x + y * y
    radial = 1 - 0.05 * r2 + 0.06 * r2**2 - 0.02 * r2**3
    ray = [
        x * radial + 2 * 0.0005 * x * y - 0.0003 * (r2 + 2 * x * x),
        y * radial + 0.0005 * (r2 + 2 * y * y) - 2 * 0.0003 * x * y,
        1.0,
    ]
    pixel = colour.camera_model(640, 480).project([ray])[0]
    np.testing.assert_allclose(pixel, (605.5 * x + 320.5, 605.25 * y + 241), atol=0.1)


def test_wrong_files_of_realsense(tmp_path: Path) -> None:
    path = written(tmp_path, REALSENSE)
    with pytest.raises(SettingsError, match="images of 640x480, 848x480, 848x800; choose yours"):
        read_camera_file(path)
    with pytest.raises(SettingsError, match="no calibration for images of 320x240; give --size"):
        read_camera_file(path, size=(320, 240))
    theta = written(tmp_path, REALSENSE.replace("Inverse Brown Conrady", "F-Theta"))
    with pytest.raises(SettingsError, match="Color has the distortion F-Theta, which is not supp"):
        read_camera_file(theta, size=(640, 480))
    short = written(tmp_path, REALSENSE.replace("  PPX:        \t320.5\n", ""))
    with pytest.raises(SettingsError, match="Color: PPX is missing"):
        read_camera_file(short, size=(640, 480))
