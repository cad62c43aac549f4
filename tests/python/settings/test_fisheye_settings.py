# SPDX-License-Identifier: BSD-3-Clause
"""Settings of fisheye cameras: from files and numbers, written and read, and what they project."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py import CameraModel, CameraSettings, Sensor, Settings, SettingsError
from orbslam2py.calibration.self_calibration import calibration_gains
from orbslam2py.calibration.two_views import PointPair
from orbslam2py.settings import settings_for_camera
from orbslam2py.settings.check import read_choice
from orbslam2py.settings.comparison import calibration_distance, compare_calibrations
from orbslam2py.settings.fit import find_misfit
from support import fisheye_cameras as fisheyes
from support import other_settings as texts
from support.fisheye_cameras import DS, DS_NAMED, EUCM, EUCM_NAMED, FOV, KB, MEI, MEI_NAMED

SIZE = (512, 512)
TUMVI = CameraSettings(
    *(190.978, 190.973, 254.932, 256.897),
    width=512,
    height=512,
    fps=20,
    model="kannala_brandt",
    lens=(0.0034824, 0.00071503, -0.0020532, 0.00020294),
)
CAMERAS = {
    "kannala_brandt": TUMVI,
    "double_sphere": replace(TUMVI, fx=158.3, fy=158.3, model="double_sphere", lens=(-0.17, 0.59)),
    "eucm": replace(TUMVI, model="eucm", lens=EUCM),
    "mei": replace(TUMVI, fx=420.0, fy=420.0, model="mei", lens=MEI),
    "fov": replace(TUMVI, model="fov", lens=FOV),
}


# ---- files ---------------------------------------------------------------------------------------
STELLA = fisheyes.STELLA
RECTIFIER = texts.STELLA_STEREO.replace(
    '  model: "perspective"\n  K_', '  model: "fisheye"\n  K_'
).replace("[-0.28, 0.07, 0.0002, 0.0001, 0.0]", "[0.02, -0.01, 0.004, -0.001]")
FILES: dict[str, tuple[str, str, tuple[float, ...]]] = {
    "ORB-SLAM3 1.0": (fisheyes.MONO, "kannala_brandt", KB),
    "ORB-SLAM3 0.x": (fisheyes.older(fisheyes.MONO), "kannala_brandt", KB),
    "with p1 and p2 of 0": (
        fisheyes.MONO + "Camera1.p1: 0.0\nCamera1.p2: 0\n",
        "kannala_brandt",
        KB,
    ),
    "with the flag": (fisheyes.older(fisheyes.MONO) + "Camera.bFishEye: 1\n", "kannala_brandt", KB),
    "the flag alone": (
        fisheyes.older(fisheyes.MONO).replace("Camera.type", "# ") + "Camera.bFishEye: 1\n",
        "kannala_brandt",
        KB,
    ),
    "one of a pair": (fisheyes.PAIR, "kannala_brandt", KB),
    "one of an older pair": (
        fisheyes.older(fisheyes.PAIR) + "Tlr: 3\nCamera2.xi: 1\nCamera.lappingBegin: 0\n",
        "kannala_brandt",
        KB,
    ),
    "DoubleSphere": (
        fisheyes.orb_slam3(texts.MONO_V1, DS_NAMED, "DoubleSphere"),
        "double_sphere",
        DS,
    ),
    "EUCM": (fisheyes.orb_slam3(texts.MONO_V1, EUCM_NAMED, "EUCM"), "eucm", EUCM),
    "Mei": (fisheyes.older(fisheyes.orb_slam3(texts.MONO_V1, MEI_NAMED, "Mei")), "mei", MEI),
    "FOV": (fisheyes.orb_slam3(texts.MONO_V1, {"omega": 0.9}, "FOV"), "fov", FOV),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_a_fisheye(tmp_path: Path, name: str) -> None:
    text, model, lens = FILES[name]
    path = tmp_path / "a.yaml"
    path.write_text(text)
    settings = Settings.load(path, "mono")
    camera = settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (460.5, 459.5, 321.5, 238.5)
    assert (camera.model, camera.lens) == (model, lens)
    assert (camera.width, camera.height, camera.fps, camera.rgb) == (640, 480, 20.0, True)
    assert not camera.distortion.any()
    assert Settings.from_yaml(settings.to_yaml(), "mono") == settings


def test_a_depth_camera_with_a_fisheye_lens(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(fisheyes.RGBD)
    settings = Settings.load(path, "rgbd")
    assert settings.camera.lens == KB
    assert settings.camera.bf == 0.075 * 460.5
    assert settings.depth_factor == 5000.0
    assert Settings.from_yaml(settings.to_yaml(), "rgbd") == settings
    assert read_choice(path).usable_sensors() == (Sensor.RGBD, Sensor.MONOCULAR)


def test_a_fisheye_of_stella_vslam(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(STELLA)
    camera = Settings.load(tmp_path / "a.yaml", "mono").camera
    assert (camera.model, camera.lens, camera.fps) == ("kannala_brandt", KB, 20.0)


def test_the_raw_left_camera_of_a_rectifier(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(RECTIFIER)
    camera = Settings.load(tmp_path / "a.yaml", "mono").camera
    assert (camera.model, camera.lens) == ("kannala_brandt", KB)
    (tmp_path / "a.yaml").write_text(RECTIFIER.replace("[0.02, ", "[0.1, 0.02, "))
    with pytest.raises(SettingsError, match=r"D_left must have 4 coefficients of a fisheye lens"):
        Settings.load(tmp_path / "a.yaml", "mono")


def test_a_pinhole_has_no_new_lines() -> None:
    """Files of pinholes stay as other programs read them."""
    text = settings_for_camera(CameraSettings(500, 500, 320, 240, k1=0.1), "mono").to_yaml()
    assert "type" not in text
    assert "Camera.k1: 0.1\n" in text
    text = settings_for_camera(TUMVI, "mono").to_yaml()
    assert "Camera.type: KannalaBrandt8\n" in text
    assert "Camera.p1" not in text


# ---- numbers -------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("sensor", ["mono", "rgbd"])
def test_numbers_are_written_and_read(name: str, sensor: str) -> None:
    settings = settings_for_camera(CAMERAS[name], sensor)
    assert Settings.from_yaml(settings.to_yaml(), sensor) == settings
    assert pickle.loads(pickle.dumps(settings)) == settings
    assert hash(settings) == hash(Settings.from_yaml(settings.to_yaml(), sensor))
    assert any(f"fisheye lens {name}: " in line for line in settings.describe())


def test_other_names_and_arrays() -> None:
    same = replace(TUMVI, model="KannalaBrandt8", lens=np.array(TUMVI.lens))
    assert same == TUMVI
    assert all(type(value) is float for value in same.lens)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "unknown model": ({"model": "cubic"}, "the camera model is 'cubic'; give pinhole .*mei, fov"),
    "no text": ({"model": 3}, "the camera model is 3; give pinhole"),
    "OpenCV's names": ({"model": "radtan4", "lens": (0,) * 4}, "'radtan4'; give pinhole"),
    "too few": ({"lens": (0.1,)}, "kannala_brandt camera has 4 lens parameters, got 1; give k1, k"),
    "no list": ({"lens": 0.1}, "the lens of a kannala_brandt camera is 0.1; give k1, k2, k3, k4"),
    "no number": ({"lens": ("a", 0, 0, 0)}, "k1 of the kannala_brandt lens is 'a'; give a number"),
    "not finite": ({"lens": (np.nan, 0, 0, 0)}, "k1 is nan; give a finite number"),
    "out of range": ({"model": "ds", "lens": (-0.2, 1.2)}, "alpha is 1.2; give a number from 0 to"),
    "pinhole with a lens": (
        {"model": "pinhole"},
        "pinhole camera has 0 lens parameters, got 4; leave it out, or name a fisheye model",
    ),
    "both": ({"k1": 0.1, "p2": 0.1}, "k1, p2 are coefficients of a pinhole camera, .*leave k1, p2"),
    "focal lengths": ({"fy": 900.0}, "fx 190.978 and fy 900 are too different for one lens"),
    "in image widths": ({"fx": 0.4, "fy": 0.4}, "are too short for an image of 512x512 pixels"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_camera_that_cannot_be(name: str) -> None:
    changes, told = WRONG[name]
    with pytest.raises(SettingsError, match=told):
        replace(TUMVI, **changes)


def test_no_pair() -> None:
    for make in (
        lambda: settings_for_camera(TUMVI, "stereo", baseline=0.1),
        lambda: replace(settings_for_camera(TUMVI, "rgbd"), sensor=Sensor.STEREO),
    ):
        with pytest.raises(SettingsError, match=r"needs both cameras and their relative pose: Cam"):
            make()


# ---- projection ----------------------------------------------------------------------------------
def test_points_are_where_opencv_projects_them() -> None:
    points = np.random.default_rng(0).uniform((-1, -1, 0.5), (1, 1, 2.5), (50, 3))
    T_cw = np.eye(4)
    T_cw[:3, :3] = cv2.Rodrigues(np.array([0.1, -0.2, 0.05]))[0]
    T_cw[:3, 3] = [0.1, 0.2, 0.3]
    in_camera = points @ T_cw[:3, :3].T + T_cw[:3, 3]
    expected, _ = cv2.fisheye.projectPoints(
        in_camera[:, None], np.zeros(3), np.zeros(3), TUMVI.matrix, np.array(TUMVI.lens)
    )
    found = TUMVI.project(points, T_cw)
    np.testing.assert_allclose(found, expected[:, 0], atol=1e-9)
    np.testing.assert_array_equal(TUMVI.project(points, T_cw, distort=False), found)


def test_points_behind_the_camera_are_seen_as_far_as_the_model_reaches() -> None:
    wide = CameraSettings(150, 150, 256, 256, model="kannala_brandt", lens=(0, 0, 0, 0))
    seen = wide.project(np.array([[1.0, 0.0, -0.5], [0.0, 0.0, -1.0]]))
    np.testing.assert_allclose(seen[0], [256 + 150 * (np.pi / 2 + np.arctan(0.5)), 256])
    assert np.isnan(seen[1]).all()


@pytest.mark.parametrize(
    ("lens", "model"),
    [
        ({}, "pinhole"),
        ({"k1": 0.1, "p1": 0.01}, "radtan4"),
        ({"k1": 0.1, "k3": 0.01}, "radtan5"),
        ({"k1": 0.1, "k6": 0.01}, "rational"),
    ],
)
def test_the_model_of_a_pinhole(lens: dict[str, float], model: str) -> None:
    camera = CameraSettings(300, 301, 320, 240, **lens)  # type: ignore[arg-type]
    found = camera.camera_model(640, 480)
    assert found.name == model
    assert found.image_size == (640, 480)
    points = np.random.default_rng(1).uniform((-0.4, -0.4, 1), (0.4, 0.4, 1.4), (20, 3))
    np.testing.assert_allclose(found.project(points), camera.project(points), atol=1e-9)


def test_the_model_of_a_fisheye() -> None:
    expected = CameraModel("kb4", [TUMVI.fx, TUMVI.fy, TUMVI.cx, TUMVI.cy, *TUMVI.lens], SIZE)
    assert TUMVI.camera_model(*SIZE) == expected
    with pytest.raises(SettingsError, match="image_size is"):
        TUMVI.camera_model(0, 512)


# ---- doubts --------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", CAMERAS)
def test_a_right_fisheye_is_not_doubted(name: str) -> None:
    settings = settings_for_camera(CAMERAS[name], "mono")
    assert settings.doubts() == []
    assert find_misfit(settings, SIZE) is None


def test_a_wide_fisheye_is_no_misfit() -> None:
    """A pinhole of this focal length would be 124 degrees wide, the fisheye has 216."""
    wide = CameraSettings(136, 136, 255, 255, model="kb4", lens=(0, 0, 0, 0))
    assert find_misfit(settings_for_camera(wide, "mono"), SIZE) is None


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"lens": (0.0,) * 4, "fx": 90.0, "fy": 90.0}, "512 326 degrees wide"),
        ({"lens": (0.0,) * 4, "fx": 3000.0, "fy": 3000.0}, "512 10 degrees wide"),
        (
            {"fx": 3.0, "fy": 3.0, "width": None, "height": None},
            "too short for an image of 512",
        ),
    ],
)
def test_a_focal_length_in_another_unit(changes: dict[str, Any], told: str) -> None:
    misfit = find_misfit(settings_for_camera(replace(TUMVI, **changes), "mono"), SIZE)
    assert misfit is not None
    assert told in str(misfit)


def test_a_lens_that_shows_nothing_is_doubted() -> None:
    """d = theta (1 - 3 theta^2) has its maximum of 0.22 at theta = 1/3."""
    (doubt,) = settings_for_camera(replace(TUMVI, lens=(-3.0, 0, 0, 0)), "mono").doubts()
    assert "the kannala_brandt lens shows nothing 127 pixels from the principal point" in doubt
    assert "check order, signs and image size" in doubt


def test_two_calibrations_of_one_fisheye() -> None:
    moved = replace(TUMVI, cx=TUMVI.cx + 3.0)
    assert calibration_distance(moved, TUMVI, SIZE) == pytest.approx(3.0, abs=1e-6)
    assert calibration_distance(TUMVI, TUMVI, SIZE) < 1e-6
    pinhole = CameraSettings(TUMVI.fx, TUMVI.fy, TUMVI.cx, TUMVI.cy)
    assert calibration_distance(pinhole, TUMVI, SIZE) > 50
    settings, data = (settings_for_camera(one, "mono") for one in (pinhole, TUMVI))
    misfit = compare_calibrations(settings, data, SIZE)
    assert misfit is not None
    assert "kannala_brandt 0.00348" in str(misfit)
    assert compare_calibrations(data, data, SIZE) is None


def test_the_self_calibration_leaves_fisheyes_out() -> None:
    points = np.random.default_rng(2).uniform(0, 512, (100, 2))
    assert calibration_gains(TUMVI, [PointPair(points, points + 5)]) is None
    assert calibration_gains(replace(TUMVI, model="pinhole", lens=()), [PointPair(points, points)])


def test_pixels_per_radian_are_those_of_the_middle() -> None:
    # Of a double sphere the radius is fx r / ((1 + xi) z) near the axis.
    camera = CameraSettings(
        fx=158,
        fy=158,
        cx=320,
        cy=320,
        width=640,
        height=640,
        model="double_sphere",
        lens=(-0.2, 0.6),
    )
    assert camera.pixels_per_radian == pytest.approx(158 / 0.8)
    assert CameraSettings(fx=200, fy=210, cx=1, cy=1).pixels_per_radian == 200
