# SPDX-License-Identifier: BSD-3-Clause
"""What a run says about itself."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from orbslam2py import Reason, Sensor
from orbslam2py.runs import RunOptions, SequenceRunner, SystemOptions
from orbslam2py.runs.outputs import OutputWriter
from orbslam2py.runs.report import make_report, peak_memory_mb
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
