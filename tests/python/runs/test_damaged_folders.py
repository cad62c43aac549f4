# SPDX-License-Identifier: BSD-3-Clause
"""Tables and paths of runs that are cut or were changed: named by file and line, in plain words."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from orbslam2py import DatasetError
from orbslam2py.runs.report_page.run_folder import read_run
from support.command_line import CommandLine, logging_restored
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.page

#: Words of Python's that nobody who runs a program knows.
INTERNALS = re.compile(r"unpack|index out of range|could not convert|invalid literal|KeyError|None")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return made_up_run(tmp_path / "r", "k" * 12 + "rl" + "k" * 12)


def refusal(run: Path) -> str:
    with pytest.raises(DatasetError) as caught:
        read_run(run)
    text = str(caught.value)
    assert "\n" not in text
    assert not INTERNALS.search(text), text
    assert text.endswith("run the sequence again")
    return text


def edit_table(run: Path, line: int, column: str, value: str) -> None:
    lines = (run / "frames.csv").read_text().splitlines()
    place = lines[0].split(",").index(column)
    fields = lines[line - 1].split(",")
    fields[place] = value
    lines[line - 1] = ",".join(fields)
    (run / "frames.csv").write_text("\n".join(lines) + "\n")


def test_an_empty_table(run: Path) -> None:
    (run / "frames.csv").write_bytes(b"")
    assert f"{run / 'frames.csv'} is empty;" in refusal(run)


@pytest.mark.parametrize("part", [0.02, 0.3, 0.5, 0.9])
def test_a_table_that_is_cut(run: Path, part: float) -> None:
    content = (run / "frames.csv").read_bytes()
    (run / "frames.csv").write_bytes(content[: int(part * len(content))])
    refusal(run)


def test_a_table_that_is_cut_within_a_line(run: Path) -> None:
    lines = (run / "frames.csv").read_text().splitlines()
    columns = len(lines[0].split(","))
    (run / "frames.csv").write_text("\n".join([*lines[:6], "5,0.5,0"]))
    told = refusal(run)
    assert f"frames.csv:7 has 3 of {columns} columns, so the file is cut or was changed" in told


def test_a_table_that_is_cut_after_a_line(run: Path) -> None:
    lines = (run / "frames.csv").read_text().splitlines(keepends=True)
    (run / "frames.csv").write_text("".join(lines[:10]))
    assert "frames.csv holds 9 frames, but report.json has 26" in refusal(run)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("state", "FOO", "there is no state 'FOO'"),
        ("state", "", "there is no state ''"),
        ("timestamp", "noon", "'noon' in the column timestamp is no number"),
        ("timestamp", "", "'' in the column timestamp is no number"),
        ("timestamp", "nan", "'nan' in the column timestamp is no number"),
        ("index", "1.5", "'1.5' in the column index is no whole number"),
        ("inliers", "many", "'many' in the column inliers is no number"),
        ("ms_track", "?", "'?' in the column ms_track is no number"),
    ],
)
def test_values_that_there_are_not(run: Path, column: str, value: str, message: str) -> None:
    edit_table(run, 5, column, value)
    assert f"frames.csv:5: {message}" in refusal(run)


def test_a_column_that_is_missing(run: Path) -> None:
    text = (run / "frames.csv").read_text()
    (run / "frames.csv").write_text(text.replace(",state,", ",condition,", 1))
    assert "frames.csv has no column state" in refusal(run)


def test_a_path_that_is_empty_or_cut(run: Path) -> None:
    lines = (run / "trajectory.txt").read_text().splitlines(keepends=True)
    for n in (0, 7):
        (run / "trajectory.txt").write_text("".join(lines[:n]))
        assert f"trajectory.txt holds {n} poses, but report.json has 24" in refusal(run)


def test_what_an_older_report_does_not_tell_is_not_asked_for(run: Path) -> None:
    report = json.loads((run / "report.json").read_text())
    for key in ("seen_frames", "maps", "main_map"):
        del report[key]
    (run / "report.json").write_text(json.dumps(report))
    assert len(read_run(run).frames) == 26


@pytest.mark.parametrize("name", ["report", "compare", "view"])
def test_commands_name_the_file(
    run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
) -> None:
    edit_table(run, 5, "state", "FOO")
    words = [name, run, made_up_run(tmp_path / "b")] if name == "compare" else [name, run]
    with logging_restored():
        done = CommandLine(monkeypatch, capsys, tmp_path)(*words)
    assert done.code == 2
    assert "frames.csv:5: there is no state 'FOO'" in " ".join(done.err.split())
    assert "Traceback" not in done.err
