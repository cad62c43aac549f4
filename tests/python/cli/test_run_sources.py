# SPDX-License-Identifier: BSD-3-Clause
"""Bad cameras and videos given to ``orbslam2py run``."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from orbslam2py import DatasetError, OrbSlamError, SettingsError
from orbslam2py.cli.app import app
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
