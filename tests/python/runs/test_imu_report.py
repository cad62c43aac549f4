# SPDX-License-Identifier: BSD-3-Clause
"""The IMU in the files of a run: its states over time, and its part of the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import InertialState
from orbslam2py.runs import RunOptions, SequenceRunner, SystemOptions
from orbslam2py.runs.outputs import OutputWriter
from orbslam2py.runs.report import make_report
from orbslam2py.runs.result import RunResult
from orbslam2py.settings import read_imu_settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.page

OPTIONS = SyntheticOptions(world="room", sensor="rgbd", frames=6, size=(320, 240), imu=True)


def run() -> RunResult:
    made = SyntheticSequence(OPTIONS)
    how = RunOptions("rgbd", SystemOptions(deterministic=True))
    return SequenceRunner(made, made.settings, None, how).run()


def with_states(result: RunResult) -> RunResult:
    """As if the IMU was used from the third frame on."""
    for k, row in enumerate(result.rows[2:], start=2):
        assert row.record is not None
        state = InertialState(
            velocity=np.array([0.3, 0.0, 0.4]),
            gyro_bias=np.array([0.01, 0.02, 0.02]),
            accel_bias=np.array([0.0, 0.0, 0.1]),
            gravity_tilt=np.radians(0.2),
            gravity_deviation=np.radians(0.1),
            innovation=None if k == 4 else 5.5,
        )
        result.rows[k] = replace(row, record=replace(row.record, inertial=state))
    return result


def test_states_over_time_and_the_page(tmp_path: Path) -> None:
    result = with_states(run())
    OutputWriter(tmp_path).write_all(result, make_report(result, None), None)
    assert result.imu_settings is not None
    assert read_imu_settings(tmp_path / "imu.yaml") == result.imu_settings
    head, *lines = (tmp_path / "imu_states.csv").read_text().splitlines()
    assert head.startswith("frame,timestamp,vx,vy,vz,gyro_bias_x,")
    assert len(lines) == 4
    assert lines[0] == (
        f"2,{result.rows[2].timestamp},0.300000,0.000000,0.400000,0.010000,0.020000,0.020000,"
        "0.000000,0.000000,0.100000,0.200000,0.100000,5.500"
    )
    assert lines[2].endswith(",0.100000,")
    page = (tmp_path / "report.html").read_text()
    for plot in ("speed", "gyro", "accel", "gravity", "innovation"):
        assert f'id="plot-imu-{plot}"' in page
    assert "the motion did not show whether it fits the camera" in page


def test_without_states_there_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "imu_states.csv").write_text("of an earlier run\n")
    result = run()
    OutputWriter(tmp_path).write_all(result, make_report(result, None), None)
    assert not (tmp_path / "imu_states.csv").exists()
    page = (tmp_path / "report.html").read_text()
    assert '<section id="imu">' in page
    assert "plot-imu" not in page
    result.imu = None
    OutputWriter(tmp_path).write_all(result, make_report(result, None), None)
    assert '<section id="imu">' not in (tmp_path / "report.html").read_text()
