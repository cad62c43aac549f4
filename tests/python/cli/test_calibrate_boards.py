# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py calibrate`` on rendered images: wide lenses, stereo pairs and rigs."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import CameraModel, Sensor, Settings
from orbslam2py.calibration import AprilGrid, CharucoBoard, Target, read_camera_file
from support.board_corners import ray_errors
from support.command_line import CommandLine
from support.rendered_boards import BoardRenderer, board_poses, texture_of

CHARUCO = CharucoBoard(6, 5, 0.04, 0.029)
CHARUCO_OPTIONS = ("--board", "charuco:6x5", "--square", "0.04", "--marker", "0.029")
LEFT = CameraModel("radtan4", [270, 270, 158, 121, -0.2, 0.05, 0, 0], (320, 240))
RIGHT = CameraModel("radtan4", [268, 268, 162, 118, -0.2, 0.05, 0, 0], (320, 240))
#: 150 and 190 degrees from side to side.
WIDE = {
    150: CameraModel("double_sphere", [112, 112, 159, 161, -0.17, 0.59], (320, 320)),
    190: CameraModel("kannala_brandt", [118, 118, 199, 201, 0.01, -4e-3, 1e-3, -2e-4], (400, 400)),
}


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> CommandLine:
    monkeypatch.setenv("COLUMNS", "150")
    return CommandLine(monkeypatch, capfd, tmp_path)


def write(folder: Path, camera: CameraModel, board: Target, poses: list[np.ndarray]) -> None:
    folder.mkdir()
    renderer = BoardRenderer(camera, texture_of(board, 30))
    for number, T in enumerate(poses):
        assert cv2.imwrite(str(folder / f"{number:02d}.png"), renderer.render(T))


@pytest.mark.parametrize("degrees", WIDE)
def test_a_wide_lens(command: CommandLine, tmp_path: Path, degrees: int) -> None:
    true = WIDE[degrees]
    board: Target = AprilGrid(3, 3, 0.05)
    arguments: tuple[str, ...] = ("--board", "aprilgrid:3x3", "--square", "0.05")
    if degrees > 180:
        board, arguments = CHARUCO, CHARUCO_OPTIONS
    poses = board_poses(board, 9, 0.42 * degrees, (0.14, 0.2))
    write(tmp_path / "views", true, board, poses)
    arguments += ("--model", true.name, "--plot", "plot.png")
    done = command("calibrate", "views", *arguments, "-o", "my.yaml")
    assert done.code == 0, done.err
    camera = Settings.load(tmp_path / "my.yaml", Sensor.MONOCULAR).camera.camera_model(
        *true.image_size
    )
    u, v = np.meshgrid(np.arange(20, 400, 35.0), np.arange(20, 400, 35.0))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    radius = np.linalg.norm(pixels - np.array(true.parameters[2:4]), axis=1)
    inside = pixels[radius < 0.45 * true.image_size[0]]
    assert ray_errors(camera, true, inside).max() < 0.35
    assert (tmp_path / "plot.png").is_file()


def test_a_pair_becomes_settings_and_a_camchain(command: CommandLine, tmp_path: Path) -> None:
    T = np.eye(4)
    T[:3, :3], T[0, 3] = cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0], -0.08
    poses = board_poses(CHARUCO, 10, 16, (0.3, 0.42))
    # The right folder is given first.
    write(tmp_path / "one", RIGHT, CHARUCO, [T @ pose for pose in poses])
    write(tmp_path / "two", LEFT, CHARUCO, poses)
    line = ("calibrate", "one", "two", *CHARUCO_OPTIONS, "--model", "radtan", "-o", "pair.yaml")
    done = command(*line, "--camchain", "chain.yaml", "--fps", "15", "--plot", "plot.png")
    assert done.code == 0, done.err
    assert "camera 1 (two) is 80." in done.out or "camera 1 (two) is 79." in done.out
    assert "two is the left camera: the settings are for left two, right one" in " ".join(
        done.out.split()
    )
    settings = Settings.load(tmp_path / "pair.yaml", Sensor.STEREO)
    assert settings.baseline == pytest.approx(0.08, abs=5e-4)
    assert (settings.camera.width, settings.camera.fps) == (320, 15)
    assert settings.rectification is not None
    assert abs(settings.rectification.left.K[0, 0] - 270) < 2
    chain = read_camera_file(tmp_path / "chain.yaml", camera=1, sensor=Sensor.STEREO)
    assert chain.baseline == pytest.approx(0.08, abs=5e-4)
    assert {path.name for path in tmp_path.glob("plot*")} == {"plot_cam0.png", "plot_cam1.png"}
    again = command(*line)
    assert again.code == 2
    assert "pair.yaml" in again.err


def test_a_rig_becomes_a_camchain(command: CommandLine, tmp_path: Path) -> None:
    T = np.eye(4)
    T[0, 3] = -0.05
    poses = board_poses(CHARUCO, 7, 14, (0.32, 0.42))
    for number in range(3):
        moved = np.linalg.matrix_power(T, number)
        write(tmp_path / f"cam{number}", LEFT, CHARUCO, [moved @ pose for pose in poses])
    done = command(
        *("calibrate", "cam0", "cam1", "cam2", *CHARUCO_OPTIONS),
        *("--model", "radtan4", "-o", "rig.yaml"),
    )
    assert done.code == 0, done.err
    assert "The camchain is in rig.yaml" in done.out
    pair = read_camera_file(tmp_path / "rig.yaml", sensor=Sensor.STEREO)
    assert pair.baseline == pytest.approx(0.05, abs=1e-3)
    assert "cam2:" in (tmp_path / "rig.yaml").read_text()
