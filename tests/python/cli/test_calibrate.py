# SPDX-License-Identifier: BSD-3-Clause
"""The commands ``orbslam2py calibrate`` and ``import-camera``."""

from __future__ import annotations

from pathlib import Path

import cv2
from typer.testing import CliRunner

from orbslam2py import OutputFileError, Sensor, Settings
from orbslam2py.cli.app import app
from support import chessboards
from support.camera_files import FX, KALIBR, written


def test_command_writes_settings_that_load(tmp_path: Path) -> None:
    (tmp_path / "views").mkdir()
    views = chessboards.write_views(tmp_path / "views")
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
    assert isinstance(again.exception, OutputFileError)
    assert "--force" in str(again.exception)


def test_the_depth_factor_is_printed(tmp_path: Path) -> None:
    (tmp_path / "views").mkdir()
    views = chessboards.write_views(tmp_path / "views")
    arguments = [
        "calibrate",
        str(views),
        "--board",
        "9x6",
        "--square",
        "0.025",
        "--max-views",
        "6",
        "--k3",
    ]
    arguments += ["--sensor", "rgbd", "--force", "--output", str(tmp_path / "my.yaml")]
    assumed = CliRunner().invoke(app, arguments)
    assert "1000 units per metre (millimetres) are assumed" in " ".join(assumed.output.split())
    given = CliRunner().invoke(app, [*arguments, "--depth-factor", "5000"])
    assert "depth images: 5000 units per metre" in given.output
    assert "assumed" not in given.output


def test_import_command(tmp_path: Path) -> None:
    output = tmp_path / "my.yaml"
    arguments = ["import-camera", str(written(tmp_path, KALIBR)), "--output", str(output)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert Settings.load(output, Sensor.MONOCULAR).camera.fx == FX
    assert isinstance(CliRunner().invoke(app, arguments).exception, OutputFileError)
    assert CliRunner().invoke(app, [*arguments, "--force"]).exit_code == 0
