# SPDX-License-Identifier: BSD-3-Clause
"""What a run says about itself."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Reason, Sensor, Trajectory
from orbslam2py.runs import FrameRow, RunOptions, RunResult, SequenceRunner, SystemOptions
from orbslam2py.runs.outputs import OutputWriter
from orbslam2py.runs.report import evaluate_run, make_report, peak_memory_mb
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


def test_peak_memory_is_in_megabytes() -> None:
    assert 20 < peak_memory_mb() < 20_000


class LateStart(SyntheticSequence):
    """Stands still for ten frames, after two black ones."""

    def load(self, index: int, /):  # type: ignore[no-untyped-def]
        images = super().load(max(0, index - 12))
        if index < 2:
            images.image[:] = 0
        return images


def test_reasons_are_in_the_files(tmp_path: Path) -> None:
    sequence = LateStart(
        SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), frames=50)
    )
    options = RunOptions(Sensor.MONOCULAR, SystemOptions(deterministic=True))
    result = SequenceRunner(sequence, sequence.settings, None, options).run()
    report = make_report(result, None)
    OutputWriter(tmp_path).write_all(result, report, None)
    counts = json.loads((tmp_path / "report.json").read_text())["initialisation_reasons"]
    with (tmp_path / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    waiting = [row for row in rows if row["state"] == "NOT_INITIALIZED"]
    assert len(waiting) >= 12
    assert counts["too few keypoints"] == 2
    assert counts[str(Reason.FIRST_VIEW)] >= 1
    assert sum(counts.values()) == len(waiting)
    assert {row["reason"] for row in waiting} == set(counts)
    assert list(counts.values()) == sorted(counts.values(), reverse=True)
    assert result.n_tracked > 20


# ---- against ground truth ------------------------------------------------------------------------
class Walk(SyntheticSequence):
    """Has a true pose for some frames only."""

    known = slice(None)

    def ground_truth(self) -> Trajectory:
        truth = super().ground_truth()
        return truth.select(np.arange(len(truth))[self.known])


def result_of(sensor: Sensor, known: slice) -> RunResult:
    """A run whose poses are the true ones, with a keyframe at the first and the last frame."""
    sequence = Walk(SyntheticOptions(sensor=sensor, world="room", frames=12, size=(80, 64)))
    path = sequence.ground_truth()
    sequence.known = known
    result = RunResult(sequence, sequence.settings, RunOptions(sensor), len(path))
    result.rows = [FrameRow(i, f"{time:.6f}", None, "") for i, time in enumerate(path.timestamps)]
    result.trajectories = [path]
    result.keyframes = path.select(np.array([0, 11]))
    return result


def test_keyframes_without_a_true_pose_leave_the_other_figures() -> None:
    result = result_of(Sensor.RGBD, slice(3, 9))
    report = make_report(result, evaluate_run(result))
    assert report["ate_keyframes_rmse_m"] is None
    assert report["ate_rmse_m"] == pytest.approx(0, abs=1e-9)
    assert (report["matched_poses"], report["matched_of_poses"]) == (6, 12)


@pytest.mark.parametrize(("sensor", "n"), [(Sensor.RGBD, 1), (Sensor.MONOCULAR, 2)])
def test_too_few_matched_poses_have_no_error(sensor: Sensor, n: int, tmp_path: Path) -> None:
    result = result_of(sensor, slice(3, 3 + n))
    evaluation = evaluate_run(result)
    report = make_report(result, evaluation)
    assert report["matched_poses"] == n
    assert report["ate_rmse_m"] is None
    assert (report["rpe_rotation_rmse_deg"] is None) == (n == 1)
    writer = OutputWriter(tmp_path)
    writer.write_all(result, report, evaluation)
    assert writer.problems == []
    assert (tmp_path / "trajectory.png").is_file()
