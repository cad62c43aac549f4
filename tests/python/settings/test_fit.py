# SPDX-License-Identifier: BSD-3-Clause
"""Calibrations that cannot belong to images of a size are named, and odd ones are left alone."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbslam2py import Sensor, Settings
from orbslam2py.settings import BUILTIN_NAMES, CameraSettings, DepthSettings, builtin_settings
from orbslam2py.settings.builtin import builtin_sensors
from orbslam2py.settings.comparison import calibration_distance, compare_calibrations
from orbslam2py.settings.fit import find_misfit

SIZES = {
    "tum1": (640, 480),
    "tum2": (640, 480),
    "tum3": (640, 480),
    "kitti00-02": (1241, 376),
    "kitti03": (1242, 375),
    "kitti04-12": (1226, 370),
    "euroc": (752, 480),
}


def mono(fx: float, fy: float, cx: float, cy: float, **more: float) -> Settings:
    return Settings(Sensor.MONOCULAR, CameraSettings(fx, fy, cx, cy, **more))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_data_sets_fit_their_own_images(name: str) -> None:
    for sensor in builtin_sensors(name):
        assert find_misfit(builtin_settings(name, sensor), SIZES[name]) is None


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_another_data_sets_settings_are_named(name: str) -> None:
    for other in BUILTIN_NAMES:
        if SIZES[other] == SIZES[name]:
            continue
        for sensor in builtin_sensors(name):
            misfit = find_misfit(builtin_settings(name, sensor), SIZES[other])
            assert misfit is not None, f"{name} for images of {other}"
            assert f"settings of {name} for images as" in misfit.cause
            assert other in misfit.cause
            assert other in misfit.remedy


@pytest.mark.parametrize(
    ("settings", "size", "words"),
    [
        (mono(525, 525, 650, 240), (640, 480), "cx 650"),
        (mono(525, 525, 320, -20), (640, 480), "cy -20"),
        (mono(1050, 1050, 639.5, 479.5), (640, 480), "about 1279 x 959"),
        (mono(260, 260, 160, 120), (640, 480), "about 320 x 240"),
        (mono(525, 525, 319.5, 239.5), (480, 640), "90 degrees"),
        (mono(4.2, 4.2, 320, 240), (640, 480), "178 degrees"),
        (mono(9000, 9000, 320, 240), (640, 480), "4 degrees"),
        (mono(525, 240, 320, 240), (640, 480), "factor of 2.2"),
        (mono(525, 525, 320, 240, width=800, height=480), (640, 480), "for 800 x 480"),
    ],
)
def test_what_cannot_be_is_told(settings: Settings, size: tuple[int, int], words: str) -> None:
    misfit = find_misfit(settings, size)
    assert misfit is not None
    text = str(misfit)
    assert words in text
    assert text.startswith("the calibration does not fit the images: ")
    assert "likely cause: " in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("settings", "size"),
    [
        (mono(1450, 1450, 540, 960), (1080, 1920)),  # a phone held upright
        (mono(240, 240, 320, 240), (640, 480)),  # 106 degrees wide
        (mono(1200, 1200, 320, 240), (640, 480)),  # 30 degrees
        (mono(525, 525, 384, 192), (640, 480)),  # principal point 10 % aside
        (mono(525, 525, 320, 90), (640, 330)),  # cut above
        (mono(525, 525, 320, 240), (640, 300)),  # cut below
        (mono(525, 394, 320, 180), (640, 360)),  # scaled to another aspect
        (mono(718.856, 718.856, 607.1928, 185.2157), (1216, 352)),  # KITTI, cut for a network
        (mono(525, 525, 320, 240, width=640, height=480), (640, 480)),
    ],
)
def test_odd_but_right_cameras_are_left_alone(settings: Settings, size: tuple[int, int]) -> None:
    assert find_misfit(settings, size) is None


@given(
    width=st.integers(160, 4000),
    aspect=st.floats(0.4, 2.5),
    focal=st.floats(0.35, 2.0),
    aside=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
)
def test_usual_cameras_are_never_told(
    width: int, aspect: float, focal: float, aside: tuple[float, float]
) -> None:
    height = round(width * aspect)
    camera = mono(focal * width, focal * width, (0.5 + aside[0]) * width, (0.5 + aside[1]) * height)
    assert find_misfit(camera, (width, height)) is None


# ---- against what comes with the images ----------------------------------------------------------
def test_a_calibration_is_compared_with_that_of_the_images() -> None:
    size = (1242, 375)
    used, right = (builtin_settings(n, Sensor.MONOCULAR) for n in ("euroc", "kitti03"))
    misfit = compare_calibrations(used, right, size)
    assert misfit is not None
    assert "fx 458.7" in misfit.seen
    assert "fx 721.5" in misfit.seen
    assert misfit.cause == "settings of EuRoC MAV for images of KITTI odometry, sequence 03"
    assert "kitti03" in misfit.remedy
    assert compare_calibrations(right, right, size) is None


@pytest.mark.parametrize("name", ["tum2", "tum3"])
def test_cameras_of_one_data_set_are_told_apart(name: str) -> None:
    one, other = (builtin_settings(n, Sensor.RGBD) for n in ("tum1", name))
    assert compare_calibrations(one, other, (640, 480)) is not None


def test_two_calibrations_of_one_camera_agree() -> None:
    one = builtin_settings("tum1", Sensor.RGBD)
    camera = one.camera
    later = replace(camera, fx=camera.fx * 1.002, cx=camera.cx + 1, cy=camera.cy - 1)
    assert compare_calibrations(replace(one, camera=later), one, (640, 480)) is None


def test_baseline_and_depth_factor_are_compared() -> None:
    stereo = builtin_settings("kitti03", Sensor.STEREO)
    wide = replace(stereo, camera=replace(stereo.camera, bf=2 * stereo.camera.bf))
    misfit = compare_calibrations(wide, stereo, (1242, 375))
    assert misfit is not None
    assert "the baseline is 1.074 m instead of 0.5372 m" in misfit.seen
    rgbd = builtin_settings("tum1", Sensor.RGBD)
    millimetres = replace(rgbd, depth=DepthSettings(40.0, 1000.0))
    misfit = compare_calibrations(millimetres, rgbd, (640, 480))
    assert misfit is not None
    assert "DepthMapFactor is 1000 instead of 5000" in misfit.seen


def test_a_pair_that_is_not_rectified_is_told() -> None:
    raw = builtin_settings("euroc", Sensor.STEREO)
    plain = replace(raw, rectification=None)
    misfit = compare_calibrations(plain, raw, (752, 480))
    assert misfit is not None
    assert "do not rectify" in misfit.seen
    misfit = compare_calibrations(raw, plain, (752, 480))
    assert misfit is not None
    assert "rectify once more" in misfit.seen


def test_distance_of_calibrations() -> None:
    one = CameraSettings(500, 500, 320, 240)
    assert calibration_distance(one, one, (640, 480)) == 0
    moved = replace(one, cx=323, cy=244)
    assert calibration_distance(moved, one, (640, 480)) == pytest.approx(5)
