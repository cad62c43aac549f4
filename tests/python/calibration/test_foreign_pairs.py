# SPDX-License-Identifier: BSD-3-Clause
"""Pairs in the files of other programs: their rectification, and how their cameras look."""

from __future__ import annotations

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.calibration import read_camera_file
from orbslam2py.settings.pair_views import views_of_pair
from support import foreign_cameras as files
from support.camera_files import KALIBR_PAIR, written
from support.foreign_cameras import BASELINE, CX, CY, FX, FY, RATIONAL, SIZE, D, kalibr_pair

PAIRS = {
    "opencv": (files.OPENCV_PAIR, None),
    "basalt": (files.BASALT_PAIR, None),
    "oak": (files.OAK, None),
    "zed": (files.zed("VGA"), None),
    "kalibr": (kalibr_pair(0), None),
    "euroc": (files.EUROC, files.EUROC_RIGHT),
    "ost": (files.OST, files.ost(-36.0)),
    "ost, both": (files.OST_PAIR, None),
}


@pytest.mark.parametrize("name", PAIRS)
def test_pair(tmp_path: Path, name: str) -> None:
    text, second = PAIRS[name]
    right = None if second is None else written(tmp_path, second, "right")
    settings = read_camera_file(written(tmp_path, text, "left"), right=right)
    assert settings.sensor is Sensor.STEREO
    assert settings.baseline == pytest.approx(BASELINE)
    pair = settings.rectification
    assert pair is not None
    np.testing.assert_allclose(pair.left.K, [[FX, 0, CX], [0, FY, CY], [0, 0, 1]])
    D_left = RATIONAL if name in ("basalt", "oak") else D
    np.testing.assert_allclose(pair.left.D[:4], D_left[:4])
    if name in ("basalt", "oak"):
        np.testing.assert_allclose(pair.right.D, RATIONAL)
    settings.save(tmp_path / "pair.yaml")
    assert Settings.load(tmp_path / "pair.yaml", "stereo") == settings


def test_points_lie_on_equal_rows(tmp_path: Path) -> None:
    """The rectification is of the file: raw pixels of one point come to one row, and its depth."""
    turn = cv2.Rodrigues(np.array([0.02, -0.03, 0.01]))[0]
    t = np.array([-0.1, 0.004, 0.003])
    text = files.OPENCV_PAIR.replace(
        files.matrix("R", [1, 0, 0, 0, 1, 0, 0, 0, 1]), files.matrix("R", turn.ravel().tolist())
    ).replace(files.matrix("T", [-BASELINE, 0, 0], 1), files.matrix("T", t.tolist(), 1))
    settings = read_camera_file(written(tmp_path, text))
    pair = settings.rectification
    assert pair is not None
    points = np.array([[0.3, 0.2, 2.0], [-0.5, 0.4, 4.0], [0.1, -0.6, 3.0]])
    seen = []
    for one, R, where in ((pair.left, np.eye(3), np.zeros(3)), (pair.right, turn, t)):
        raw, _ = cv2.projectPoints(points, R, where, one.K, one.D)
        straight = cv2.undistortPoints(raw, one.K, one.D, R=one.R, P=one.P[:, :3])
        seen.append(np.asarray(straight).reshape(-1, 2))
    np.testing.assert_allclose(seen[0][:, 1], seen[1][:, 1], atol=1e-3)
    depth = (points @ pair.left.R.T)[:, 2]
    np.testing.assert_allclose(settings.camera.bf / (seen[0] - seen[1])[:, 0], depth, rtol=1e-3)


@pytest.mark.parametrize(
    "names",
    [
        ("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2"),
        ("K1", "D1", "K2", "D2"),
        ("left_camera_matrix", "left_dist_coeffs", "right_camera_matrix", "right_dist_coeffs"),
        ("cameraMatrixL", "distCoeffsL", "cameraMatrixR", "distCoeffsR"),
    ],
)
def test_other_names_of_opencv(tmp_path: Path, names: tuple[str, ...]) -> None:
    text = files.OPENCV_PAIR
    for old, new in zip(("M1", "D1", "M2", "D2"), names, strict=True):
        text = text.replace(f"{old}:", f"{new}:")
    expected = read_camera_file(written(tmp_path, files.OPENCV_PAIR))
    assert read_camera_file(written(tmp_path, text)) == expected


def test_size_of_an_opencv_pair(tmp_path: Path) -> None:
    head = "image_width: 640\nimage_height: 480\n"
    path = written(tmp_path, files.OPENCV_PAIR.replace(head, ""))
    with pytest.raises(SettingsError, match=r"--size WIDTHxHEIGHT \(.* 644x478\).*--camera 0"):
        read_camera_file(path)
    expected = read_camera_file(written(tmp_path, files.OPENCV_PAIR, "whole"))
    assert read_camera_file(path, size=SIZE) == expected
    listed = written(tmp_path, files.OPENCV_PAIR.replace(head, "image_size: [640, 480]\n"))
    assert read_camera_file(listed) == expected
    assert read_camera_file(listed, camera=1).camera.fx == FX + 1


def test_pair_without_its_place(tmp_path: Path) -> None:
    text = files.OPENCV_PAIR.partition("R: !!")[0]
    path = written(tmp_path, text)
    with pytest.raises(SettingsError, match=r"stand to each other; add R and T, or .*--camera 0"):
        read_camera_file(path)
    assert read_camera_file(path, camera=0).camera.fx == FX


def test_the_left_camera_is_chosen(tmp_path: Path) -> None:
    path = written(tmp_path, kalibr_pair(0, BASELINE))
    with pytest.raises(SettingsError, match=r"to the left of it; give --camera 1 --sensor stereo"):
        read_camera_file(path)
    settings = read_camera_file(path, camera=1, sensor="stereo")
    assert settings.baseline == pytest.approx(BASELINE)


@pytest.mark.parametrize(
    ("x", "y", "z", "where"),
    [(0, 0.1, 0, "above it"), (0, -0.1, 0, "below it"), (0, 0, 0.1, "before or behind it")],
)
def test_cameras_that_are_not_side_by_side(
    tmp_path: Path, x: float, y: float, z: float, where: str
) -> None:
    text = files.OPENCV_PAIR.replace(
        files.matrix("T", [-BASELINE, 0, 0], 1), files.matrix("T", [x, y, z], 1)
    )
    with pytest.raises(SettingsError, match=rf"but 0.1 m {where}; .*--camera 0"):
        read_camera_file(written(tmp_path, text))


# ---- how they look -------------------------------------------------------------------------------
@pytest.mark.parametrize("degrees", [0, 5, 20])
def test_cameras_that_look_the_same_way(tmp_path: Path, degrees: float) -> None:
    pair = read_camera_file(written(tmp_path, kalibr_pair(degrees))).rectification
    assert pair is not None
    views = views_of_pair(pair)
    assert views.turned == pytest.approx(degrees, abs=0.01)
    assert views.overlap > 0.65


@pytest.mark.parametrize("degrees", [100, 180])
def test_cameras_that_see_nothing_together(tmp_path: Path, degrees: float) -> None:
    path = written(tmp_path, kalibr_pair(degrees))
    told = rf"cam0 and cam1 are turned by {degrees} degrees .*take one of them with --camera 0$"
    with pytest.raises(SettingsError, match=told):
        read_camera_file(path)
    assert read_camera_file(path, camera=0).camera.fx == FX


def test_what_is_left_out_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "orbslam2py.calibration.camera_files")
    path = written(tmp_path, KALIBR_PAIR)
    read_camera_file(path)
    read_camera_file(path, camera=0)
    assert not caplog.messages
    read_camera_file(path, sensor="mono")
    read_camera_file(written(tmp_path, files.OAK, "oak"))
    assert caplog.messages == [
        f"{path} holds 2 cameras; the settings are of cam0, not of cam1 (--camera 1)",
        f"{tmp_path}/oak holds 3 cameras; the settings are of socket 1 and socket 2, not of socket "
        "0 (--camera 0)",
    ]
