# SPDX-License-Identifier: BSD-3-Clause
"""Fisheye cameras of other programs: read with the right numbers, or refused with the reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.calibration.camera_files import read_camera_file
from orbslam2py.settings.comparison import calibration_distance
from orbslam2py.settings.fisheye import fisheye_model
from support import fisheye_cameras as fisheyes
from support import foreign_cameras as files
from support.fisheye_cameras import FCA_HEAD, FILES, KB, KB_NAMED, kalibr
from support.foreign_cameras import CX, CY, FX, FY


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("sensor", ["mono", "rgbd"])
def test_a_fisheye_is_read(tmp_path: Path, name: str, sensor: str) -> None:
    text, model, lens = FILES[name]
    (tmp_path / "file").write_text(text)
    settings = read_camera_file(tmp_path / "file", sensor=sensor)
    camera = settings.camera
    one_focal_length = name in ("colmap radial", "colmap simple")
    fy = FX if one_focal_length else FY
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (FX, fy, CX, CY)
    assert (camera.model, camera.lens) == (model, lens)
    assert (camera.width, camera.height) == (640, 480)
    assert not camera.is_distorted
    assert settings.sensor == sensor
    assert not settings.doubts()
    assert Settings.from_yaml(settings.to_yaml(), sensor) == settings


def test_a_region_of_interest_moves_the_centre_of_a_fisheye(tmp_path: Path) -> None:
    text = fisheyes.ROS.replace("x_offset: 0", "x_offset: 20").replace("y_offset: 0", "y_offset: 8")
    (tmp_path / "file").write_text(text)
    camera = read_camera_file(tmp_path / "file").camera
    assert (camera.cx, camera.cy, camera.width, camera.height) == (CX - 20, CY - 8, 620, 472)
    assert camera.lens == KB


#: What is wrong, and what the message must say.
WRONG: dict[str, tuple[str, str]] = {
    "three of four": (
        kalibr("pinhole", "equidistant", (), *KB[:3]),
        "cam0.distortion_coeffs must hold the 4 numbers k1, k2, k3, k4 of a fisheye lens",
    ),
    "five numbers": (
        fisheyes.ROS.replace("-0.001]", "-0.001, 0.3]"),
        "distortion must hold the 4 numbers k1, k2, k3, k4",
    ),
    "alpha": (kalibr("ds", "none", (-0.2, 1.6)), "alpha is 1.6; give a number from 0 to 1"),
    "another order": (
        kalibr("ds", "none", ()).replace(f"{CY}]", f"{CY}, -0.2, 0.6]"),
        "xi is 300.5; give a number from -1 to 1. The order of the parameters is fx",
    ),
    "ds with radtan": (
        kalibr("ds", "radtan", fisheyes.DS, 0.1, 0.1, 0, 0),
        "cam0.distortion_model radtan does not go with the double_sphere lens",
    ),
    "omni with equidistant": (
        kalibr("omni", "equidistant", (1.2,), *KB),
        "cam0.distortion_model equidistant does not go with the mei lens",
    ),
    "ds of Basalt without alpha": (
        files.basalt("ds", files.NUMBERS | {"xi": -0.2}),
        "cam0.alpha is missing",
    ),
    "omega": (
        f"1 FOV 640 480 {fisheyes.COLMAP} 3.5\n",
        "omega is 3.5; give a number from 0 to 3.14159",
    ),
    "too few of COLMAP": (
        f"1 OPENCV_FISHEYE 640 480 {fisheyes.COLMAP} 0.02\n",
        "parameters of OPENCV_FISHEYE must hold 8",
    ),
    "no model of COLMAP": (
        f"1 EQUIDISTANT 640 480 {fisheyes.COLMAP} 0 0 0 0\n",
        "COLMAP has no camera model EQUIDISTANT; give one of SIMPLE_PINHOLE",
    ),
    "thin prism": ("1 THIN_PRISM_FISHEYE 640 480 300 300 320 240\n", "equidistant with a thin pr"),
    "scaramuzza": (
        "model_type: SCARAMUZZA\nimage_width: 640\nimage_height: 480\n",
        "polynomial model of Scaramuzza), which is not supported; calibrate the camera",
    ),
    "mei without a mirror": (
        fisheyes.VINS_MEI.replace("mirror_parameters", "mirror"),
        "mirror_parameters is missing",
    ),
    "a pinhole with xi": (
        json.dumps({**files.NUMBERS, "xi": 1.2, "model": "pinhole"}),
        "the model pinhole is a pinhole's, and the numbers are those of a mei lens",
    ),
    "no focal length": (
        FCA_HEAD.replace("fy", "f") + fisheyes.listed(KB_NAMED),
        "parameter.fy is missing",
    ),
    "degrees": (
        kalibr("pinhole", "fov", (), 50.0),
        "omega is 50; give a number from 0 to 3.14159, both excluded",
    ),
    "ros with ds": (
        fisheyes.ROS.replace("equidistant", "double_sphere"),
        "ROS has no rule for the coefficients of distortion_model double_sphere",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_fisheye_that_cannot_be(tmp_path: Path, name: str) -> None:
    text, told = WRONG[name]
    (tmp_path / "file").write_text(text)
    with pytest.raises(SettingsError) as caught:
        read_camera_file(tmp_path / "file", sensor="mono")
    assert str(tmp_path / "file") in str(caught.value)
    assert told in str(caught.value)


@pytest.mark.parametrize("kind", ["kb4", "ds", "eucm"])
def test_a_pair_of_fisheyes_is_read_and_one_of_them(tmp_path: Path, kind: str) -> None:
    values = files.NUMBERS | KB_NAMED | fisheyes.DS_NAMED | fisheyes.EUCM_NAMED
    (tmp_path / "file").write_text(files.basalt(kind, values, {**values, "fx": 290.0}))
    for sensor in (None, "stereo"):
        settings = read_camera_file(tmp_path / "file", sensor=sensor)
        assert settings.sensor is Sensor.STEREO
        if settings.right is not None:
            raw = settings.camera, settings.right.camera
            assert [one.fx for one in raw] == [FX, 290.0]
            assert raw[0].model == raw[1].model == fisheye_model(kind)
        else:
            pair = settings.rectification
            assert pair is not None
            assert [one.K[0, 0] for one in (pair.left, pair.right)] == [FX, 290.0]
            assert pair.left.model == fisheye_model(kind)
    assert read_camera_file(tmp_path / "file", camera=1).camera.fx == 290.0
    assert read_camera_file(tmp_path / "file", sensor="mono").camera.fx == FX


# ---- real files ----------------------------------------------------------------------------------
#: What each file gives, or why it is refused.
REAL = {
    "adapter_euroc_cam0_DS.yml": "double_sphere",
    "adapter_euroc_cam0_EUCM.yml": "eucm",
    "adapter_euroc_cam0_KB.yml": "kannala_brandt",
    "adapter_euroc_cam0_RadTan.yml": "pinhole",
    "basalt_euroc_ds_calib.json": "double_sphere",
    "basalt_euroc_eucm_calib.json": "eucm",
    "basalt_t265_kb4_calib.json": "kannala_brandt",
    "basalt_tumvi_512_ds_calib.json": "double_sphere",
    "basalt_tumvi_512_eucm_calib.json": "eucm",
    "tumvi512_kalibr_equidistant_camchain.yaml": "kannala_brandt",
    "euroc_models.yaml": "cam0.camera_model is missing",
    "tumvi_imu.yaml": "is no camera file we know",
    "woodscape_front.json": "kannala_brandt",
}


@pytest.mark.shared
def test_real_calibrations(shared_data: Path) -> None:
    """All of one camera agree with each other: they see the same directions at the same pixels."""
    cameras = {}
    for name, expected in REAL.items():
        path = shared_data / "calib" / name
        if " " in expected or "." in expected:
            with pytest.raises(SettingsError) as caught:
                read_camera_file(path, sensor="mono")
            assert expected in str(caught.value)
            continue
        settings = read_camera_file(path, sensor="mono")
        assert settings.camera.model == expected
        assert not settings.doubts()
        cameras[name.rpartition(".")[0]] = settings.camera
    euroc = [camera for name, camera in cameras.items() if "euroc" in name]
    assert len(euroc) == 6
    tumvi = [camera for name, camera in cameras.items() if "tumvi" in name]
    assert len(tumvi) == 3
    for group, size, most in ((euroc, (752, 480), 1.5), (tumvi, (512, 512), 0.5)):
        for other in group[1:]:
            assert calibration_distance(group[0], other, size) < most
