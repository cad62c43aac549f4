# SPDX-License-Identifier: BSD-3-Clause
"""Settings for one's own camera: what is usual, what was meant, and other programs' files."""

from __future__ import annotations

import math
import os
import threading
from pathlib import Path

import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.settings import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    builtin_settings,
    settings_for_camera,
)
from orbslam2py.settings.check import read_choice
from orbslam2py.settings.sensor import WITHOUT_RIG
from support.camera_files import KALIBR, KITTI, OPENCV, ROS, written
from support.settings_files import DEPTH, MONO, refusal, write

CAMERA = CameraSettings(525.0, 520.0, 319.5, 239.5, width=640, height=480)


# ---- usual values --------------------------------------------------------------------------------
def test_usual_values_of_a_phone_with_depth(tmp_path: Path) -> None:
    settings = settings_for_camera(CAMERA, "rgbd")
    assert settings.sensor is Sensor.RGBD
    assert settings.orb == OrbSettings(1000, 1.2, 8, 20, 7)
    assert settings.depth == DepthSettings(40.0, 1000.0)
    assert settings.baseline == pytest.approx(0.075)
    assert settings.close_depth == pytest.approx(3.0)
    settings.save(tmp_path / "a.yaml")
    assert Settings.load(tmp_path / "a.yaml", Sensor.RGBD) == settings


def test_usual_values_of_a_pair_and_of_one_camera() -> None:
    pair = settings_for_camera(CAMERA, Sensor.STEREO, baseline=0.12)
    assert pair.baseline == pytest.approx(0.12)
    assert pair.depth == DepthSettings(40.0)
    alone = settings_for_camera(pair.camera, Sensor.MONOCULAR)
    assert (alone.camera.bf, alone.depth) == (0.0, None)


def test_large_images_get_more_features() -> None:
    large = CameraSettings(900.0, 900.0, 640.0, 360.0, width=1280, height=720)
    assert settings_for_camera(large, "mono").orb.n_features == 2000
    few = settings_for_camera(large, "mono", orb=OrbSettings(n_features=500))
    assert few.orb.n_features == 500


def test_what_is_known_counts() -> None:
    settings = settings_for_camera(CAMERA, "rgbd", baseline=0.05, depth_factor=5000)
    assert settings.depth_factor == 5000
    assert settings.close_depth == pytest.approx(2.0)
    tum = builtin_settings("tum3", Sensor.RGBD)
    assert settings_for_camera(tum.camera, "rgbd", depth_factor=5000).camera == tum.camera


@pytest.mark.parametrize(
    ("sensor", "options", "message"),
    [
        ("stereo", {}, "baseline is missing; stereo needs"),
        ("stereo", {"baseline": 0.0}, "the baseline is 0; give"),
        ("rgbd", {"baseline": math.nan}, "the baseline is nan; give"),
        ("rgbd", {"baseline": -0.1}, "in metres, above 0"),
        ("mono", {"baseline": 0.1}, "leave it out for mono"),
        ("mono", {"depth_factor": 1000}, "goes with rgbd; leave it out for mono"),
        ("stereo", {"depth_factor": 1000, "baseline": 0.1}, "leave it out for stereo"),
        ("rgbd", {"depth_factor": 0}, "DepthMapFactor is 0; .*5000 for TUM"),
    ],
)
def test_what_does_not_go_together(sensor: str, options: dict[str, float], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        settings_for_camera(CAMERA, sensor, **options)  # type: ignore[arg-type]


def test_a_pair_must_be_rectified() -> None:
    distorted = CameraSettings(525.0, 520.0, 319.5, 239.5, k1=0.1)
    with pytest.raises(SettingsError, match=r"must be rectified.*import-camera"):
        settings_for_camera(distorted, "stereo", baseline=0.1)


# ---- what was meant ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("fx", "Camera.fx"),
        ("FY", "Camera.fy"),
        ("camera.fx", "Camera.fx"),
        ("width", "Camera.width"),
        ("image_height", "Camera.height"),
        ("fps", "Camera.fps"),
        ("bf", "Camera.bf"),
        ("k1", "Camera.k1"),
        ("rgb", "Camera.RGB"),
        ("nFeatures", "ORBextractor.nFeatures"),
        ("n_features", "ORBextractor.nFeatures"),
        ("depth_map_factor", "DepthMapFactor"),
        ("depth_scale", "DepthMapFactor"),
        ("th_depth", "ThDepth"),
    ],
)
def test_short_names_are_understood(tmp_path: Path, key: str, meant: str) -> None:
    path = write(tmp_path / "a.yaml", MONO, f"{key}: 1\n")
    assert refusal(path) == f"{path}:13: unknown key {key}; did you mean {meant}?"


@pytest.mark.parametrize("key", ["baseline", "Camera.baseline"])
def test_a_baseline_in_metres_gets_the_name_that_counts_metres(tmp_path: Path, key: str) -> None:
    path = write(tmp_path / "a.yaml", MONO, f"{key}: 1\n")
    told = f"{path}:13: unknown key {key}; did you mean Stereo.b (the baseline in metres)?"
    assert refusal(path) == told


def test_metres_per_unit_become_units_per_metre(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", MONO, "depth_scale: 0.001\n")
    assert "did you mean DepthMapFactor: 1000 (units per metre)?" in refusal(path)


@pytest.mark.parametrize(
    ("key", "usual"),
    [
        ("Camera.fx", "times the image's width"),
        ("ORBextractor.nFeatures", "usual: 1000"),
        ("ORBextractor.scaleFactor", "usual: 1.2"),
        ("ORBextractor.nLevels", "usual: 8"),
        ("ORBextractor.iniThFAST", "usual: 20"),
        ("ORBextractor.minThFAST", "usual: 7"),
        ("ThDepth", "usual: 35 to 40"),
        ("Camera.bf", "usual: 40 for rgbd"),
    ],
)
def test_usual_values_are_named(tmp_path: Path, key: str, usual: str) -> None:
    values = {name: value for name, value in {**MONO, **DEPTH}.items() if name != key}
    message = refusal(write(tmp_path / "a.yaml", values), Sensor.RGBD)
    assert usual in message
    assert "\n" not in message


def test_a_file_with_little_in_it_is_told_how_to_get_a_whole_one(tmp_path: Path) -> None:
    message = refusal(write(tmp_path / "a.yaml", {"Camera.fx": "500"}), Sensor.RGBD)
    assert message.endswith(
        "orbslam2py settings new --sensor rgbd --fx FX --fy FY --cx CX --cy CY "
        "--depth-factor 1000 --output my.yaml"
    )


# ---- what a file is for --------------------------------------------------------------------------
def test_a_file_is_told_by_its_keys(tmp_path: Path) -> None:
    mono = write(tmp_path / "mono.yaml", MONO)
    rgbd = write(tmp_path / "rgbd.yaml", {**MONO, **DEPTH})
    pair = {name: value for name, value in DEPTH.items() if name != "DepthMapFactor"}
    stereo = write(tmp_path / "stereo.yaml", {**MONO, **pair})
    assert [read_choice(path).likely_sensor for path in (mono, rgbd, stereo)] == [
        *(Sensor.MONOCULAR, Sensor.RGBD, Sensor.STEREO),
    ]
    assert read_choice(mono).usable_sensors() == (Sensor.MONOCULAR,)
    assert read_choice(rgbd).usable_sensors() == (Sensor.RGBD, Sensor.MONOCULAR)
    assert read_choice(stereo).usable_sensors() == (Sensor.STEREO, Sensor.MONOCULAR)
    assert read_choice("tum1").usable_sensors() == (Sensor.RGBD, Sensor.MONOCULAR)
    assert read_choice("kitti06").likely_sensor is Sensor.STEREO


def test_a_pipe_is_read_once(tmp_path: Path) -> None:
    whole = write(tmp_path / "rgbd.yaml", {**MONO, **DEPTH}).read_text()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=pipe.write_text, args=(whole,), daemon=True).start()
    chosen = read_choice(pipe)
    assert chosen.usable_sensors() == (Sensor.RGBD, Sensor.MONOCULAR)
    assert chosen.load(Sensor.RGBD) == Settings.load(tmp_path / "rgbd.yaml", Sensor.RGBD)


# ---- other programs' files -----------------------------------------------------------------------
@pytest.mark.parametrize("sensor", WITHOUT_RIG)
@pytest.mark.parametrize(
    ("text", "whose"),
    [
        (KALIBR, "a camchain of Kalibr"),
        (OPENCV, "a calibration of OpenCV"),
        (ROS, "a camera_info of ROS"),
        ("1 PINHOLE 640 480 500 510 320 240\n", "a camera list of COLMAP"),
        (KITTI, "a calibration of KITTI"),
        ("<?xml version='1.0'?>\n<opencv_storage>\n</opencv_storage>\n", "of OpenCV"),
    ],
)
def test_calibration_as_settings_is_told_the_command(
    tmp_path: Path, text: str, whose: str, sensor: Sensor
) -> None:
    path = written(tmp_path, text, "my camera.yaml")
    message = refusal(path, sensor)
    assert f"{path} is {whose if whose[:2] == 'a ' else ''}" in message
    assert whose in message
    line = message.splitlines()[-1].strip()
    assert line.startswith(f"orbslam2py import-camera '{path}' --sensor {sensor} ")
    assert line.endswith("--output my.yaml")


def test_settings_with_matrices_are_settings(tmp_path: Path) -> None:
    path = tmp_path / "pair.yaml"
    builtin_settings("euroc", Sensor.STEREO).save(path)
    assert Settings.load(path, Sensor.STEREO) == builtin_settings("euroc", Sensor.STEREO)
