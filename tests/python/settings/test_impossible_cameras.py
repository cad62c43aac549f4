# SPDX-License-Identifier: BSD-3-Clause
"""Numbers that no camera has, alone or together with the size of its images."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.settings import (
    BUILTIN_NAMES,
    CameraRectification,
    CameraSettings,
    StereoRectification,
    builtin_settings,
)
from orbslam2py.settings.builtin import builtin_sensors
from orbslam2py.settings.check import doubts_of_size
from support.settings_files import DEPTH, MONO, refusal, write


def matrix(
    fx: float = 458.0, fy: float = 457.0, cx: float = 367.0, cy: float = 248.0
) -> np.ndarray:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def rectified(K: np.ndarray, P: np.ndarray | None = None) -> CameraRectification:
    P = np.hstack([matrix() if P is None else P, np.zeros((3, 1))])
    return CameraRectification(K, np.zeros(4), np.eye(3), P, 752, 480)


# ---- the raw cameras of a pair -------------------------------------------------------------------
@pytest.mark.parametrize(
    ("K", "told"),
    [(matrix(-458.0), "-458, 457"), (matrix(fy=0.0), "458, 0"), (matrix(2e5), "200000, 457")],
)
def test_focal_lengths_of_a_raw_camera(K: np.ndarray, told: str) -> None:
    for what, make in (("K", lambda: rectified(K)), ("P", lambda: rectified(matrix(), K))):
        with pytest.raises(SettingsError, match="focal lengths") as refused:
            make()
        assert str(refused.value).startswith(f"{what} has the focal lengths {told}")
        assert "greater than 0 and at most 100000 pixels" in str(refused.value)


def test_they_are_refused_in_a_file(tmp_path: Path) -> None:
    text = builtin_settings("euroc", Sensor.STEREO).to_yaml()
    first = "458.65399999999999" if "458.65399999999999" in text else "458.654"
    path = tmp_path / "pair.yaml"
    path.write_text(text.replace(first, f"-{first}", 1))
    with pytest.raises(SettingsError, match=r"pair\.yaml:\d+: LEFT: K has the focal lengths -458"):
        Settings.load(path, Sensor.STEREO)


# ---- depth ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("bf", ["1e-300", "9e-7"])
def test_a_baseline_smaller_than_an_atom(tmp_path: Path, bf: str) -> None:
    message = refusal(write(tmp_path / "a.yaml", {**MONO, **DEPTH, "Camera.bf": bf}), Sensor.RGBD)
    assert (
        f"Camera.bf is {bf.replace('e-7', 'e-07')}; allowed: 1e-06 to 1e+06 pixel metres" in message
    )
    with pytest.raises(SettingsError, match=r"Camera\.bf"):
        CameraSettings(500, 500, 320, 240, bf=float(bf))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"Camera.bf": "0.04"}, "Camera.bf 0.04 by Camera.fx is a baseline of 7.73e-05 m"),
        ({"Camera.bf": "40000"}, "Camera.bf 40000 by Camera.fx is a baseline of 77.3 m"),
        ({"ThDepth": "0.001"}, "ThDepth 0.001 is very little"),
        ({}, ""),
    ],
)
def test_doubtful_depth(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, values: dict[str, str], told: str
) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, **DEPTH, **values})
    for sensor in (Sensor.STEREO, Sensor.RGBD):
        caplog.clear()
        Settings.load(path, sensor)
        assert caplog.text.count(told) == (1 if told else caplog.text.count(told))
        assert bool(caplog.records) == bool(told)
    caplog.clear()
    Settings.load(path, Sensor.MONOCULAR)
    assert not caplog.records


# ---- the size of the images ----------------------------------------------------------------------
def test_a_calibration_of_larger_images() -> None:
    whole = Settings(
        Sensor.MONOCULAR, CameraSettings(525, 525, 319.5, 239.5, width=640, height=480)
    )
    assert doubts_of_size(whole) == []
    half = replace(whole, camera=replace(whole.camera, width=320, height=240))
    (doubt,) = doubts_of_size(half)
    assert "does not fit the images" in doubt
    assert "about 639 x 479" in doubt
    unknown = replace(whole, camera=replace(whole.camera, width=None))
    assert doubts_of_size(unknown) == []


def test_the_raw_cameras_of_a_pair_are_looked_at() -> None:
    pair = builtin_settings("euroc", Sensor.STEREO)
    assert pair.rectification is not None
    small = replace(pair.rectification.right, width=376, height=240)
    doubts = doubts_of_size(
        replace(pair, rectification=StereoRectification(pair.rectification.left, small))
    )
    (doubt,) = doubts
    assert doubt.startswith("RIGHT.K: ")
    assert "larger or smaller images" in doubt


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_published_settings_are_not_doubted(name: str, caplog: pytest.LogCaptureFixture) -> None:
    """Though those of KITTI name one size for the images of three cameras."""
    caplog.set_level(logging.WARNING)
    for sensor in builtin_sensors(name):
        settings = builtin_settings(name, sensor)
        assert doubts_of_size(settings) == []
        assert doubts_of_size(Settings.from_yaml(settings.to_yaml(), sensor)) == []
    assert not caplog.records
