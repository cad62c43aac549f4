# SPDX-License-Identifier: BSD-3-Clause
"""Settings of raw pairs: which are rectified, how they are written, and what is refused."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py._arrays import FloatArray
from orbslam2py.settings import RightCamera
from orbslam2py.settings.pair_cameras import cameras_of_pair
from support.raw_pairs import SIZE, distorted_pair, extrinsics, fisheye, fisheye_pair


@pytest.mark.parametrize(("degrees", "rectified"), [(60, True), (105, True), (115, False)])
def test_a_fisheye_pair_is_rectified_if_that_stretches_little(
    degrees: float, *, rectified: bool
) -> None:
    settings = fisheye_pair(degrees)
    assert (settings.rectification is not None) is rectified
    assert (settings.right is None) is rectified


@pytest.mark.parametrize("settings", [fisheye_pair(90), fisheye_pair(195), distorted_pair()])
def test_files_keep_everything(settings: Settings) -> None:
    read = Settings.from_yaml(settings.to_yaml(), "stereo")
    assert read == settings
    assert copy.deepcopy(settings) == settings
    assert not settings.doubts()
    assert settings.baseline == pytest.approx(0.10003, abs=1e-5)
    mono = Settings.from_yaml(settings.to_yaml(), "mono")
    assert mono.right is None


def test_a_rectified_fisheye_sees_points_in_one_row_with_their_disparity() -> None:
    settings = fisheye_pair(90)
    pair = settings.rectification
    assert pair is not None
    point = np.array([[0.3, -0.2, 2.0]])
    seen = []
    for side, T in ((pair.left, np.eye(4)), (pair.right, extrinsics())):
        p = side.R @ (T[:3, :3] @ point[0] + T[:3, 3])
        seen.append(side.P[:, :3] @ p / p[2])
    camera = settings.camera
    depth = (pair.left.R @ point[0])[2]
    assert seen[0][1] == pytest.approx(seen[1][1], abs=1e-9)
    assert seen[0][0] - seen[1][0] == pytest.approx(camera.bf / depth, abs=1e-9)


def test_a_mixed_pair_is_matched_as_it_is() -> None:
    pinhole = replace(fisheye(60), model="pinhole", lens=(), k1=-0.1)
    found = cameras_of_pair(pinhole, fisheye(170), extrinsics(), SIZE)
    assert found.right is not None
    settings = Settings(Sensor.STEREO, **found.fields, depth=fisheye_pair(150).depth)
    assert Settings.from_yaml(settings.to_yaml(), "stereo") == settings
    assert not settings.doubts()


def inverse(T: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(T))


def scaled(T: FloatArray) -> FloatArray:
    return np.asarray(T * np.array([[1.1], [1.1], [1.1], [1.0]]))


def upright(T: FloatArray) -> FloatArray:
    turned = T.copy()
    turned[:3, 3] = [0.0, -0.1, 0.0]
    return turned


def in_place(T: FloatArray) -> FloatArray:
    still = T.copy()
    still[:3, 3] = 0
    return still


@pytest.mark.parametrize("degrees", [90, 195])
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            inverse,
            r"T_rl the right camera stands 0\.1 m to the left of the left one; exchange left",
        ),
        (scaled, "T_rl is no rigid transform; give 4 x 4 numbers: a rotation and a translation"),
        (upright, "T_rl the cameras stand one above the other, and a pair must stand side by"),
        (in_place, "the two cameras of the pair have the same position, so they measure no depth;"),
    ],
)
def test_extrinsics_that_cannot_be(degrees: float, change: object, told: str) -> None:
    T = change(extrinsics())  # type: ignore[operator]
    with pytest.raises(SettingsError, match=told):
        cameras_of_pair(fisheye(degrees), fisheye(degrees), T, SIZE, "T_rl")


def test_millimetres_are_doubted() -> None:
    T = extrinsics()
    T[:3, 3] *= 1000
    for degrees in (90, 195):
        found = cameras_of_pair(fisheye(degrees), fisheye(degrees), T, SIZE)
        settings = Settings(Sensor.STEREO, **found.fields, depth=fisheye_pair(150).depth)
        assert any("is the calibration in millimetres?" in doubt for doubt in settings.doubts())


def test_a_pair_is_rectified_or_has_a_right_camera() -> None:
    wide, flat = fisheye_pair(195), fisheye_pair(90)
    with pytest.raises(SettingsError, match="rectification and right are both given"):
        replace(wide, rectification=flat.rectification)
    with pytest.raises(SettingsError, match="T_left_right is no rigid transform"):
        RightCamera(fisheye(150), np.ones((4, 4)))
    with pytest.raises(SettingsError, match="needs both cameras and their relative pose"):
        replace(wide, right=None)
