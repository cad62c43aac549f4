# SPDX-License-Identifier: BSD-3-Clause
"""Warnings that repeat are counted after the third, and what was counted is told."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from rich.console import Console

from orbslam2py.cli.messages import log_to, tell_repeated
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.command_line import CommandLine, Results, logging_restored

pytestmark = pytest.mark.watchdog(30)

log = logging.getLogger("orbslam2py.somewhere")


def warned(capsys: pytest.CaptureFixture[str], n: int) -> list[str]:
    with logging_restored():
        log_to(Console(stderr=True), quiet=False)
        for i in range(n):
            log.warning("frame %d skipped: %s", i, f"{i}.png is empty")
        log.warning("something else")
        for _ in range(5):
            log.error("an error")
        tell_repeated()
        tell_repeated()
    return capsys.readouterr().err.splitlines()


@pytest.mark.parametrize("n", [1, 3])
def test_three_are_told(capsys: pytest.CaptureFixture[str], n: int) -> None:
    lines = warned(capsys, n)
    assert lines[:n] == [f"Warning: frame {i} skipped: {i}.png is empty" for i in range(n)]
    assert lines[n:] == ["Warning: something else", *["Error: an error"] * 5], (
        "no error is left out"
    )


def test_the_fourth_is_told_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    assert warned(capsys, 4)[-1] == "Warning: frame 3 skipped: 3.png is empty"


def test_more_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    lines = warned(capsys, 700)
    assert sum("skipped" in line for line in lines) == 4
    assert lines[-1] == "Warning: 697 more like this, the last: frame 699 skipped: 699.png is empty"


def test_of_a_run(command: CommandLine, tmp_path: Path) -> None:
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=14, size=(320, 240))
    SyntheticSequence(options).write(tmp_path / "lap")
    for path in sorted((tmp_path / "lap/rgb").iterdir())[5:]:
        path.write_bytes(b"")
    done = command("run", "lap", "--sensor", "rgbd", "--output", "r")
    assert done.err.count("\n") == 4, done.err
    assert "Warning: 6 more like this, the last: frame 13 skipped: " in done.err
    report = Results(Path("r")).report
    assert (report["skipped_frames"], report["seen_frames"]) == (9, 14)
