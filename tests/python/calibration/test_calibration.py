# SPDX-License-Identifier: BSD-3-Clause
"""Calibration on made-up views of a board, and import of other programs' files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from orbslam2py.calibration.calibration import Calibration, calibrate
from orbslam2py.calibration.camera_files import CameraFileFormat, read_camera_file
from orbslam2py.calibration.chessboard import Board, BoardViews, choose_views, find_views
from orbslam2py.cli.app import app
from orbslam2py.errors import DatasetError, ImageError, SettingsError
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import CameraSettings, Settings
from support import chessboards

BOARD = Board(chessboards.COLUMNS, chessboards.ROWS, chessboards.SQUARE)


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("board")
    for i, T_cb in enumerate(chessboards.poses(16)):
        assert cv2.imwrite(str(folder / f"{i}.png"), chessboards.render(T_cb))
    return folder


@pytest.fixture(scope="module")
def found(views: Path) -> BoardViews:
    return find_views(views, BOARD)


@pytest.fixture(scope="module")
def result(found: BoardViews) -> Calibration:
    return calibrate(found, BOARD)


def test_calibration_recovers_the_camera(result: Calibration) -> None:
    np.testing.assert_allclose(result.K, chessboards.K, atol=0.8)
    np.testing.assert_allclose(result.distortion[:2], chessboards.DISTORTION[:2], atol=0.02)
    np.testing.assert_allclose(result.distortion[2:], chessboards.DISTORTION[2:], atol=5e-4)
    assert result.rms < 0.15
    assert result.size == chessboards.SIZE
    assert result.rms == pytest.approx(np.sqrt((result.residuals**2).sum(axis=1).mean()), rel=1e-3)
    nearest, farthest = result.distances
    assert 0.2 < nearest < farthest < 0.6


def test_distances_follow_the_size_of_the_squares(found: BoardViews, result: Calibration) -> None:
    twice = calibrate(found, Board(9, 6, 2 * chessboards.SQUARE))
    np.testing.assert_allclose(twice.distances, 2 * np.array(result.distances), rtol=1e-3)
    np.testing.assert_allclose(twice.K, result.K, rtol=1e-4)


def test_doubtful_calibrations_say_so(found: BoardViews) -> None:
    few = BoardViews(found.size, found.views[:4], found.n_searched)
    assert any("only 4 different views" in text for text in calibrate(few, BOARD).warnings())


def test_views_that_do_not_fit_are_left_out(found: BoardViews) -> None:
    bent = [*found.views]
    noise = np.random.default_rng(0).normal(0, 5, bent[3].corners.shape)
    bent[3] = type(bent[3])(bent[3].name, bent[3].corners + noise)
    result = calibrate(BoardViews(found.size, bent, found.n_searched), BOARD)
    assert result.left_out == (bent[3].name,)
    assert result.rms < 0.15


def test_chosen_views_differ(found: BoardViews) -> None:
    doubled = BoardViews(found.size, [*found.views, *found.views], 32)
    chosen = choose_views(doubled, 100)
    assert len(chosen) <= len(found.views)
    assert len({view.name for view in chosen}) == len(chosen)
    assert len(choose_views(found, 5)) == 5


def test_command_writes_settings_that_load(views: Path, tmp_path: Path) -> None:
    output, plot = tmp_path / "my.yaml", tmp_path / "residuals.png"
    arguments = ["calibrate", str(views), "--board", "9x6", "--square", "0.025", "--fps", "20"]
    arguments += ["--output", str(output), "--plot", str(plot)]
    outcome = CliRunner().invoke(app, arguments)
    assert outcome.exit_code == 0, outcome.output
    assert "reprojection error" in outcome.output
    camera = Settings.load(output, Sensor.MONOCULAR).camera
    assert abs(camera.fx - chessboards.K[0, 0]) < 0.8
    assert (camera.width, camera.height, camera.fps) == (640, 480, 20)
    picture = cv2.imread(str(plot))
    assert picture is not None
    assert picture.std() > 10
    again = CliRunner().invoke(app, arguments)
    assert isinstance(again.exception, SettingsError)
    assert "--force" in str(again.exception)


def test_video_of_a_board(views: Path, tmp_path: Path) -> None:
    path = tmp_path / "board.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 8, chessboards.SIZE)
    for i in range(16):
        writer.write(cv2.imread(str(views / f"{i}.png")))
    writer.release()
    found = find_views(path, BOARD)  # eight frames per second: every second one
    assert (found.n_searched, found.fps) == (8, 8)
    np.testing.assert_allclose(calibrate(found, BOARD).K, chessboards.K, atol=4)


def test_bad_input(views: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no images in"):
        find_views(tmp_path, BOARD)
    with pytest.raises(DatasetError, match="does not exist"):
        find_views(tmp_path / "none", BOARD)
    (tmp_path / "a.png").write_bytes(b"x")
    with pytest.raises(ImageError, match="none of the 1 images"):
        find_views(tmp_path, BOARD)
    cv2.imwrite(str(tmp_path / "b.png"), np.full((480, 640), 90, np.uint8))
    with pytest.raises(DatasetError, match="no board of 9x6 inner corners in any of the 2 images"):
        find_views(tmp_path, BOARD)
    cv2.imwrite(str(tmp_path / "c.png"), np.full((400, 640), 90, np.uint8))
    with pytest.raises(DatasetError, match=r"c\.png of .* is 640 x 400, the images before it 640"):
        find_views(tmp_path, BOARD)


def test_too_few_views(found: BoardViews) -> None:
    few = BoardViews(found.size, found.views[:3], 20)
    with pytest.raises(DatasetError, match=r"only 3 different views .*3 of 20 images"):
        calibrate(few, BOARD)


@pytest.mark.parametrize("text", ["9", "9x", "axb", "9x6x2", "2x6", "900x6"])
def test_bad_boards(text: str) -> None:
    with pytest.raises(SettingsError, match="inner corners"):
        Board.parse(text, 0.025)


# ---- other programs' files -----------------------------------------------------------------------
FX, FY, CX, CY = 520.5, 515.25, 325.75, 236.125
D = (-0.25, 0.08, 0.0008, -0.0006)
OPENCV = f"""%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {FX}, 0., {CX}, 0., {FY}, {CY}, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ {D[0]}, {D[1]}, {D[2]}, {D[3]}, 0. ]
"""
KALIBR = f"""cam0:
  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: [{D[0]}, {D[1]}, {D[2]}, {D[3]}]
  intrinsics: [{FX}, {FY}, {CX}, {CY}]
  resolution: [640, 480]
"""
KALIBR_PAIR = (
    KALIBR
    + KALIBR.replace("cam0", "cam1")
    + """  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
"""
)
ROS = f"""image_width: 640
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [{FX}, 0, {CX}, 0, {FY}, {CY}, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [{D[0]}, {D[1]}, {D[2]}, {D[3]}, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0]
"""


def written(tmp_path: Path, text: str, name: str = "camera.yaml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("text", [OPENCV, KALIBR, ROS], ids=["opencv", "kalibr", "ros"])
def test_imported_camera_is_the_true_one(tmp_path: Path, text: str) -> None:
    settings = read_camera_file(written(tmp_path, text), fps=20, n_features=1500)
    assert settings.sensor is Sensor.MONOCULAR
    assert settings.camera == CameraSettings(FX, FY, CX, CY, *D, width=640, height=480, fps=20)
    assert settings.orb.n_features == 1500


def test_opencv_xml(tmp_path: Path) -> None:
    path = tmp_path / "camera.xml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("cameraMatrix", np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]]))
    storage.write("distCoeffs", np.array(D))
    storage.release()
    camera = read_camera_file(path).camera
    assert camera == CameraSettings(FX, FY, CX, CY, *D)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("SIMPLE_PINHOLE 640 480 500 320 240", (500, 500, 319.5, 239.5)),
        ("PINHOLE 640 480 500 510 320 240", (500, 510, 319.5, 239.5)),
        ("SIMPLE_RADIAL 640 480 500 320 240 0.1", (500, 500, 319.5, 239.5, 0.1)),
        ("RADIAL 640 480 500 320 240 0.1 0.2", (500, 500, 319.5, 239.5, 0.1, 0.2)),
        (
            "OPENCV 640 480 500 510 320 240 0.1 0.2 0.01 0.02",
            (500, 510, 319.5, 239.5, 0.1, 0.2, 0.01, 0.02),
        ),
    ],
)
def test_colmap(tmp_path: Path, line: str, expected: tuple[float, ...]) -> None:
    path = written(tmp_path, f"# Camera list\n3 {line}\n", "cameras.txt")
    assert read_camera_file(path).camera == CameraSettings(*expected, width=640, height=480)
    assert read_camera_file(path, camera=3).camera.fx == 500
    with pytest.raises(SettingsError, match="no camera 1; there are: 3"):
        read_camera_file(path, camera=1)


def test_kalibr_pair(tmp_path: Path) -> None:
    path = written(tmp_path, KALIBR_PAIR)
    settings = read_camera_file(path)
    assert settings.sensor is Sensor.STEREO
    assert settings.baseline == pytest.approx(0.11)
    assert settings.rectification is not None
    np.testing.assert_allclose(settings.rectification.right.K[0, 0], FX)
    settings.save(tmp_path / "pair.yaml")
    assert Settings.load(tmp_path / "pair.yaml", Sensor.STEREO) == settings
    assert read_camera_file(path, camera=1).sensor is Sensor.MONOCULAR
    with pytest.raises(SettingsError, match="to the right of the first"):
        read_camera_file(written(tmp_path, KALIBR_PAIR.replace("-0.11", "0.11")))


def test_ros_pair(tmp_path: Path) -> None:
    left = written(tmp_path, ROS, "left.yaml")
    right = written(tmp_path, ROS.replace("320, 0, 0", "320, -60, 0"), "right.yaml")
    settings = read_camera_file(left, right=right)
    assert settings.sensor is Sensor.STEREO
    assert settings.camera.bf == 60
    assert settings.baseline == pytest.approx(0.12)
    assert (settings.camera.fx, settings.camera.cx) == (500, 320)
    with pytest.raises(SettingsError, match="to the right of the first"):
        read_camera_file(left, right=left)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (KALIBR.replace("pinhole", "omni"), r"camera_model omni .*supported: pinhole"),
        (KALIBR.replace("radtan", "equidistant"), r"equidistant .*supported: radtan, none"),
        (ROS.replace("plumb_bob", "equidistant"), r"equidistant .*supported: plumb_bob"),
        ("1 FISHEYE 640 480 1 2 3\n", r"FISHEYE .*supported: SIMPLE_PINHOLE, PINHOLE"),
        ("1 PINHOLE 640 480 1 2 3\n", "parameters of PINHOLE must hold 4"),
        ("1 PINHOLE 9 9 1 1 1 1\n2 PINHOLE 9 9 1 1 1 1\n", r"lists 2 cameras \(1, 2\)"),
        (KALIBR.replace("intrinsics", "other"), r"cam0\.intrinsics is missing"),
        (KALIBR.replace(str(FX), "x"), "must hold 4 finite numbers"),
        (ROS.replace("data: [520.5", "data: [520.5, 1"), "must hold 9 finite numbers"),
        (OPENCV.replace("camera_matrix", "matrix_of_camera"), "has no camera matrix"),
        (OPENCV.replace(f"[ {FX}, 0.,", f"[ {FX}, 5.,"), "skew"),
        ("cam0: [\n", "is no YAML"),
        ("hello\n", "no camera file we know"),
    ],
)
def test_bad_camera_files(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        read_camera_file(written(tmp_path, text))


def test_options_that_do_not_fit_the_format(tmp_path: Path) -> None:
    path = written(tmp_path, OPENCV)
    with pytest.raises(SettingsError, match="holds one camera"):
        read_camera_file(path, camera=0)
    with pytest.raises(SettingsError, match="goes with ros"):
        read_camera_file(path, right=path)
    with pytest.raises(SettingsError, match="cannot open"):
        read_camera_file(tmp_path / "none.yaml", CameraFileFormat.ROS)


def test_import_command(tmp_path: Path) -> None:
    output = tmp_path / "my.yaml"
    arguments = ["import-camera", str(written(tmp_path, KALIBR)), "--output", str(output)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert Settings.load(output, Sensor.MONOCULAR).camera.fx == FX
    assert isinstance(CliRunner().invoke(app, arguments).exception, SettingsError)
    assert CliRunner().invoke(app, [*arguments, "--force"]).exit_code == 0
