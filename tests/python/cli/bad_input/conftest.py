# SPDX-License-Identifier: BSD-3-Clause
"""Sequences that a test may spoil."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from orbslam2py import Sensor
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.spoilt_runs import N


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[Sensor, Path]:
    folder = tmp_path_factory.mktemp("sequences")
    made = {}
    for sensor in (Sensor.RGBD, Sensor.STEREO):
        options = SyntheticOptions(world="corridor", sensor=sensor, frames=N, size=(320, 240))
        made[sensor] = SyntheticSequence(options).write(folder / str(sensor))
    return made


@pytest.fixture
def rgbd(originals: dict[Sensor, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(originals[Sensor.RGBD], tmp_path / "lap"))


@pytest.fixture
def stereo(originals: dict[Sensor, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(originals[Sensor.STEREO], tmp_path / "street"))
