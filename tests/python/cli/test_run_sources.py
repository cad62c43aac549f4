# SPDX-License-Identifier: BSD-3-Clause
"""What ``orbslam2py run`` takes: a folder without any option; bad cameras and videos."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from orbslam2py import DatasetError, OrbSlamError, SettingsError
from orbslam2py.cli.app import app
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.command_line import CommandLine, Results
from support.numbered_images import write_video


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("video") / "walk.mp4")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (["97", "--settings", "tum1"], DatasetError, "camera 97 cannot be opened"),
        (["{video}"], SettingsError, "orbslam2py calibrate"),
        (["{video}", "--settings", "tum1", "--times", "no.txt"], DatasetError, "cannot open no"),
        (["{video}", "--settings", "tum1", "--mask", "no.png"], DatasetError, "mask no.png"),
        (["{video}", "--settings", "tum1", "--fps", "0"], SettingsError, "--fps"),
    ],
)
def test_run_refuses_bad_sources(
    video: Path, arguments: list[str], error: type[OrbSlamError], message: str
) -> None:
    arguments = [argument.replace("{video}", str(video)) for argument in arguments]
    result = CliRunner().invoke(app, ["run", *arguments, "--sensor", "mono"])
    assert isinstance(result.exception, error)
    assert message in str(result.exception)


@pytest.mark.watchdog(40)
def test_colour_folder_of_kitti_runs_without_an_option(
    command: CommandLine, tmp_path: Path
) -> None:
    options = SyntheticOptions(world="corridor", sensor="stereo", frames=4, size=(320, 240))
    folder = SyntheticSequence(options).write(tmp_path / "07")
    for grey, colour in ((0, 2), (1, 3)):
        (folder / f"image_{grey}").rename(folder / f"image_{colour}")
    calibration = folder / "calib.txt"
    calibration.write_text(calibration.read_text().replace("P0:", "P2:").replace("P1:", "P3:"))
    (folder / "settings.yaml").unlink(missing_ok=True)
    done = command("run", folder, "--output", "r")
    assert done.code == 0, done.err
    report = Results(Path("r")).report
    assert (report["sensor"], report["layout"], report["tracked"]) == ("stereo", "kitti", 4)
    assert report["ate_rmse_m"] < 0.05
