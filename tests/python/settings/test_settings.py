# SPDX-License-Identifier: BSD-3-Clause
"""Settings made in Python."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import SettingsError, System
from orbslam2py import _core as core
from orbslam2py.settings import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Sensor,
    Settings,
    builtin_settings,
)


def test_values_are_checked_without_a_file_too() -> None:
    with pytest.raises(SettingsError, match=r"Camera\.fx is -1.*Camera\.fy is not finite"):
        CameraSettings(-1.0, math.nan, 0.0, 0.0)
    with pytest.raises(SettingsError, match="which is 5"):
        OrbSettings(ini_th_fast=5)
    with pytest.raises(SettingsError, match="give 1 to 16"):
        OrbSettings(n_levels="eight")  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="ThDepth"):
        DepthSettings(0.0)
    with pytest.raises(SettingsError, match=r"DepthMapFactor is 0; .*1000 for millimetres"):
        DepthSettings(40.0, 0.0)
    camera = CameraSettings(500.0, 500.0, 320.0, 240.0)
    with pytest.raises(SettingsError, match=r"Camera\.bf.*ThDepth"):
        Settings(Sensor.RGBD, camera)


def test_a_depth_camera_must_say_the_unit_of_its_depth_in_python_too() -> None:
    camera = CameraSettings(500.0, 500.0, 320.0, 240.0, bf=40.0)
    with pytest.raises(SettingsError, match=r"DepthMapFactor \(depth\.raw_per_metre\) is missing"):
        Settings(Sensor.RGBD, camera, depth=DepthSettings(40.0))
    assert Settings(Sensor.RGBD, camera, depth=DepthSettings(40.0, 1.0)).depth_factor == 1.0
    assert Settings(Sensor.STEREO, camera, depth=DepthSettings(40.0)).depth_factor == 1.0


def test_numpy_numbers_become_plain_ones() -> None:
    camera = CameraSettings(np.float64(500), np.float32(500), np.int64(320), 240)
    assert type(camera.fx) is float
    assert type(camera.cx) is float


def test_settings_cannot_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        builtin_settings("tum1", Sensor.RGBD).camera.fx = 1.0  # type: ignore[misc]


def test_equal_settings_have_equal_hashes() -> None:
    """Zero has two signs."""
    euroc = builtin_settings("euroc", Sensor.STEREO)
    assert euroc.rectification is not None
    first = euroc.rectification.left
    second = dataclasses.replace(first, K=np.where(first.K == 0, -0.0, first.K))
    assert first == second
    assert hash(first) == hash(second)


def test_distortion_vector() -> None:
    camera = CameraSettings(500, 500, 320, 240, p2=0.1)
    np.testing.assert_array_equal(camera.distortion, [0, 0, 0, 0.1])
    assert camera.is_distorted
    assert dataclasses.replace(camera, k3=0.5).distortion.shape == (5,)
    rational = dataclasses.replace(camera, k3=0.5, k5=-2.0)
    np.testing.assert_array_equal(rational.distortion, [0, 0, 0, 0.1, 0.5, 0, -2.0, 0])
    assert "distortion (k1, k2, p1, p2, k3, k4, k5, k6): 0, 0, 0, 0.1, 0.5, 0, -2, 0" in (
        Settings("mono", rational).describe()
    )
    assert "Camera.k6: 0.0" in Settings("mono", rational).to_yaml()
    assert "Camera.k4" not in Settings("mono", camera).to_yaml()
    assert not CameraSettings(500, 500, 320, 240).is_distorted


def test_description_names_the_figures() -> None:
    text = "\n".join(builtin_settings("tum1", Sensor.RGBD).describe())
    for figure in ("517.306", "0.262383", "1000 features", "20 and 7", "3.093 m", ": 5000 units"):
        assert figure in text


@pytest.mark.parametrize("threshold", [1, 254])
def test_the_extractor_takes_every_threshold_that_settings_take(threshold: int) -> None:
    orb = OrbSettings(ini_th_fast=threshold, min_th_fast=threshold)
    core.OrbExtractor(
        core.OrbOptions(initial_threshold=orb.ini_th_fast, minimum_threshold=orb.min_th_fast)
    )
    with pytest.raises(SettingsError, match="1 to 254"):
        core.OrbExtractor(core.OrbOptions(initial_threshold=255, minimum_threshold=7))


def test_one_camera_has_no_baseline(tmp_path: Path) -> None:
    """As its file, which does not hold one."""
    camera = CameraSettings(525, 525, 319.5, 239.5, bf=40.0)
    settings = Settings("mono", camera, depth=DepthSettings(35))
    assert (settings.camera.bf, settings.depth, settings.baseline) == (0.0, None, 0.0)
    settings.save(tmp_path / "mono.yaml")
    assert Settings.load(tmp_path / "mono.yaml", "mono") == settings
    with System(settings) as slam:
        slam.track_monocular(np.zeros((480, 640), np.uint8), 0.0)
