# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of several cameras together, and the files that are made of it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import CameraModel, DatasetError, Sensor, Settings, SettingsError
from orbslam2py.calibration import (
    AprilGrid,
    BoardViews,
    RigCalibration,
    calibrate_rig,
    camchain_text,
    pair_settings_text,
    read_camera_file,
)
from orbslam2py.calibration.rig_files import check_camchain, left_first
from support.board_corners import CAMERAS, views_of_poses
from support.rendered_boards import board_poses

BOARD = AprilGrid(5, 4, 0.04)
LEFT = CAMERAS["radtan4"]
RIGHT = CameraModel("radtan4", [462, 461, 315, 243, -0.27, 0.07, -1e-4, 2e-4], (640, 480))


def pose(turn: tuple[float, float, float], position: tuple[float, float, float]) -> np.ndarray:
    """Camera 0 to a camera that is turned and stands somewhere, (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array(turn))[0]
    T[:3, 3] = -T[:3, :3] @ position
    return T


T_RIGHT = pose((0.01, -0.03, 0.005), (0.12, 0.002, -0.001))


def views(
    cameras: list[CameraModel], T_c0: list[np.ndarray], n: int = 14, degrees: float = 25
) -> list[BoardViews]:
    T_0b = board_poses(BOARD, n, degrees, (0.3, 0.5))
    return [
        views_of_poses(camera, BOARD, [T @ one for one in T_0b], seed=number)
        for number, (camera, T) in enumerate(zip(cameras, T_c0, strict=True))
    ]


@pytest.fixture(scope="module")
def pair() -> RigCalibration:
    return calibrate_rig(views([LEFT, RIGHT], [np.eye(4), T_RIGHT]), BOARD, model="radtan4")


def test_the_pose_between_two_cameras_is_recovered(pair: RigCalibration) -> None:
    np.testing.assert_allclose(pair.positions[1], (0.12, 0.002, -0.001), atol=2e-4)
    turned = pair.T_c0[1][:3, :3] @ T_RIGHT[:3, :3].T
    assert np.degrees(np.linalg.norm(cv2.Rodrigues(turned)[0])) < 0.05
    assert pair.rms == pytest.approx(0.05 * np.sqrt(2), rel=0.1)
    assert pair.n_shared >= 10
    assert np.all(pair.deviations[1][:3] < 3e-4)
    assert np.all(pair.deviations[1][:3] > 1e-6)
    for one, true in zip(pair.cameras, (LEFT, RIGHT), strict=True):
        np.testing.assert_allclose(one.camera.parameters[:4], true.parameters[:4], atol=0.8)
    assert pair.warnings() == []


def test_settings_of_a_pair_are_read(pair: RigCalibration, tmp_path: Path) -> None:
    path = tmp_path / "pair.yaml"
    path.write_text(pair_settings_text(pair, fps=20.0))
    settings = Settings.load(path, Sensor.STEREO)
    assert settings.baseline == pytest.approx(0.12, abs=3e-4)
    assert settings.camera.fps == 20
    assert settings.rectification is not None
    np.testing.assert_allclose(settings.rectification.right.K, pair.cameras[1].K, rtol=1e-12)
    np.testing.assert_allclose(settings.rectification.left.D, pair.cameras[0].distortion[:4])


def test_a_camchain_is_read_back(pair: RigCalibration, tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(camchain_text(pair))
    settings = read_camera_file(path, sensor=Sensor.STEREO)
    assert settings.baseline == pytest.approx(0.12, abs=3e-4)
    first = read_camera_file(path, camera=1, sensor=Sensor.MONOCULAR).camera
    assert first.camera_model(640, 480) == pair.cameras[1].camera


@pytest.mark.parametrize("family", ["kannala_brandt", "double_sphere", "eucm", "mei", "fov"])
def test_camchains_hold_all_wide_lenses(pair: RigCalibration, tmp_path: Path, family: str) -> None:
    one = pair.cameras[0]
    changed = type(one)(
        **{
            name: getattr(one, name)
            for name in ("deviations", "rms", "board", "views", "left_out", "n_searched", "n_found")
        },
        camera=CAMERAS[family],
    )
    rig = type(pair)((changed, changed), pair.T_c0, pair.deviations, 0.1, (0.1, 0.1), 9, 9)
    path = tmp_path / "camchain.yaml"
    path.write_text(camchain_text(rig))
    camera = read_camera_file(path, camera=0, sensor=Sensor.MONOCULAR).camera
    assert camera.camera_model(*CAMERAS[family].image_size) == CAMERAS[family]


def test_exchanged_cameras_are_put_in_order(pair: RigCalibration) -> None:
    assert left_first(pair) == (pair, False)
    backwards = pair.reordered((1, 0))
    np.testing.assert_allclose(backwards.positions[1][0], -0.12, atol=5e-3)
    again, exchanged = left_first(backwards)
    assert exchanged
    np.testing.assert_allclose(again.T_c0[1], pair.T_c0[1], atol=1e-12)
    assert again.cameras == pair.cameras


def test_a_rig_of_wide_lenses_whose_ends_never_see_the_board_together() -> None:
    camera = CAMERAS["kannala_brandt"]
    # Camera 2 looks backwards; only camera 1, which looks to the side, sees the board with it.
    turns = [np.eye(4), pose((0, -1.3, 0), (0.1, 0, 0)), pose((0, -2.6, 0), (0.1, 0, -0.1))]
    found = views([camera] * 3, turns, 40, 150)
    rig = calibrate_rig(found, BOARD, model="kannala_brandt")
    for T, true in zip(rig.T_c0, turns, strict=True):
        np.testing.assert_allclose(T[:3, :3], true[:3, :3], atol=2e-3)
        np.testing.assert_allclose(T[:3, 3], true[:3, 3], atol=1e-3)
    assert "T_cn_cnm1" in camchain_text(rig)


def test_images_are_paired_by_order_if_their_names_differ() -> None:
    left, right = views([LEFT, RIGHT], [np.eye(4), T_RIGHT], 10)
    renamed = BoardViews(
        right.size,
        [type(one)("b" + one.name, one.corners, one.ids) for one in right.views],
        right.n_searched,
        names=["b" + name for name in right.names],
    )
    rig = calibrate_rig([left, renamed], BOARD, model="radtan4")
    np.testing.assert_allclose(rig.positions[1], (0.12, 0.002, -0.001), atol=4e-4)
    assert any("paired by their order" in text for text in rig.warnings())
    renamed.names.pop()
    with pytest.raises(DatasetError, match="have 10, 9 images, whose names do not agree; give"):
        calibrate_rig([left, renamed], BOARD, model="radtan4")


def test_images_of_other_moments_are_told() -> None:
    left, _ = views([LEFT, RIGHT], [np.eye(4), T_RIGHT], 12)
    moved = [T_RIGHT @ pose((0, 0.01 * (i % 3), 0), (0.004 * (i % 4), 0, 0)) for i in range(12)]
    T_0b = board_poses(BOARD, 12, 25, (0.3, 0.5))
    right = views_of_poses(RIGHT, BOARD, [A @ B for A, B in zip(moved, T_0b, strict=True)])
    rig = calibrate_rig([left, right], BOARD, model="radtan4")
    assert any("must be of the same moment" in text for text in rig.warnings())


def test_cameras_that_never_see_the_board_together() -> None:
    left, right = views([LEFT, RIGHT], [np.eye(4), T_RIGHT], 16)
    left.views, right.views = left.views[:8], right.views[8:]
    with pytest.raises(DatasetError, match=r"camera 1 sees the board together .* only 0 sets"):
        calibrate_rig([left, right], BOARD, model="radtan4")


def test_what_files_cannot_hold(pair: RigCalibration) -> None:
    with pytest.raises(SettingsError, match="cannot hold a lens of the model rational; give"):
        check_camchain("rational")
    small = CameraModel("radtan4", RIGHT.parameters, (640, 400))
    one = pair.cameras[1]
    other = type(one)(small, one.deviations, one.rms, one.board, one.views, (), 1, 1)
    rig = type(pair)((pair.cameras[0], other), pair.T_c0, pair.deviations, 0.1, (0.1, 0.1), 9, 9)
    with pytest.raises(SettingsError, match=r"640 x 480 and 640 x 400, .* at the same resolution"):
        pair_settings_text(rig, fps=30)
