# SPDX-License-Identifier: BSD-3-Clause
"""Runs of sequences of which a part is spoilt."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.trajectory import read_tum
from support.command_line import CommandLine, Outcome, Results

N = 14
BAD = 6
"""The frame that is spoilt."""


def nth(folder: Path, index: int = BAD) -> Path:
    return sorted(folder.iterdir())[index]


def expect_skipped(done: Outcome, folder: str, message: str, index: int = BAD) -> None:
    """One frame is left out with a warning; all others have a pose."""
    assert done.code == 0, done.err
    assert done.err.count("Warning: frame") == 1, done.err
    assert f"Warning: frame {index} skipped: " in done.err
    assert message in done.err
    results = Results(Path(folder))
    assert results.report["skipped_frames"] == 1
    assert results.report["tracked"] == results.report["frames"] - 1
    row = results.frames[index]
    assert row["state"] == "SKIPPED"
    assert message in row["reason"]
    assert row["tx"] == row["inliers"] == row["map"] == ""
    assert len(read_tum(Path(folder, "trajectory.txt"))) == results.report["frames"] - 1


def expect_refused(done: Outcome, *messages: str) -> None:
    """Exit code 2, a message, no results."""
    assert done.code == 2, done.err
    assert done.err.startswith("Error: ")
    assert done.err.count("\n") <= 12
    for message in messages:
        assert message in done.err
    assert "Traceback" not in done.err
    assert not Path("r").exists()


def run(command: CommandLine, folder: Path, sensor: str = "rgbd", *more: object) -> Outcome:
    return command("run", folder, "--sensor", sensor, "--output", "r", *more)
