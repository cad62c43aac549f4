# SPDX-License-Identifier: BSD-3-Clause
"""What plays recorded sequences with two versions in turns."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import pytest
from benchmarks.versions import turns

CASE = turns.Case("made up, mono", "made_up", "mono")


def report(fps: float, ate: float | None) -> dict[str, Any]:
    return {
        "frames_per_second": fps,
        "slam_frames_per_second": 2 * fps,
        "milliseconds": {"track": {"median": 3.0}, "mapping": {"mean": 7.0}},
        "ate_rmse_m": ate,
    }


def test_both_versions_play_every_turn_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    runs: list[tuple[Any, ...]] = []

    def run_report(folder: Path, sensor: str, *options: str, python: str = "this") -> Any:
        runs.append((python, folder, sensor, *options))
        return report(10.0 if python == "other" else 25.0, 0.02)

    monkeypatch.setattr(turns, "run_report", run_report)
    tables: list[Any] = []
    arguments = argparse.Namespace(
        before="old", deterministic=True, turns=2, options="--effort thorough"
    )
    turns.print_turns(tables.append, [CASE], Path("all"), "other", arguments)
    place = Path("all/made_up")
    first, second = ["--deterministic", "--start", "0"], ["--deterministic", "--start", "1"]
    assert runs == [
        ("other", place, "mono", *first),
        ("this", place, "mono", *first, "--effort", "thorough"),
        ("other", place, "mono", *second),
        ("this", place, "mono", *second, "--effort", "thorough"),
    ]
    (table,) = tables
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells[:5] == ["made up, mono", "10.0", "25.0", "2.50", "2.50"]
    assert cells[-3:] == ["0.0200", "0.0200", "1.00"]


def test_medians_are_compared() -> None:
    before = [report(fps, ate) for fps, ate in ((10, 0.1), (20, 0.2), (90, 0.9))]
    cells = turns.row(before, [report(40, 0.1)])
    assert cells[:3] == ["20.0", "40.0", "2.00"]
    assert cells[-3:] == ["0.2000", "0.1000", "0.50"]


def test_without_truth_there_is_no_error_to_compare() -> None:
    cells = turns.row([report(10, None)], [report(10, None)])
    assert cells[-3:] == ["nan", "nan", "nan"]


def test_threads_have_seeds() -> None:
    assert turns.options_of_turn(3, deterministic=False) == ["--seed", "3"]


def test_another_version_must_be_installed(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="run make install there"):
        turns.python_of(tmp_path)
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    assert turns.python_of(tmp_path) == str(python)


@pytest.mark.parametrize("options", [["--turns", "0"], ["--only", "nothing"]])
def test_nothing_to_play_is_said(
    options: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(turns, "needed_shared_folder", lambda: tmp_path)
    monkeypatch.setattr(turns, "python_of", lambda checkout: "other")
    monkeypatch.setattr(sys, "argv", ["turns", str(tmp_path), *options])
    with pytest.raises(SystemExit):
        turns.main()
    assert "nothing to play" in capsys.readouterr().err
