# SPDX-License-Identifier: BSD-3-Clause
"""Folders that are no runs, or that should not be compared."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.command_line import CommandLine
from support.made_up_runs import made_up_run


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return made_up_run(tmp_path / "run", "k" * 12)


@pytest.mark.parametrize("subcommand", ["report", "compare"])
def test_no_run(command: CommandLine, run: Path, tmp_path: Path, subcommand: str) -> None:
    others = [run] if subcommand == "compare" else []
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    half = made_up_run(tmp_path / "half", "k" * 12)
    (half / "frames.csv").unlink()
    for name, message in (
        ("none", "is no folder"),
        ("file", "is no folder"),
        ("empty", "report.json is missing"),
        ("half", "frames.csv is missing"),
    ):
        done = command(subcommand, *others, tmp_path / name)
        assert done.code == 2
        assert done.err.startswith("Error: ")
        assert message in done.err
        assert str(tmp_path / name) in done.err
        assert "Errno" not in done.err
        assert "Traceback" not in done.err
    assert not Path("compare.html").exists()


def test_one_run_alone(command: CommandLine, run: Path) -> None:
    done = command("compare", run)
    assert done.code == 2
    assert "one run cannot be compared" in done.err
    assert "orbslam2py report" in done.err


def test_runs_of_different_sequences(command: CommandLine, run: Path, tmp_path: Path) -> None:
    other = made_up_run(tmp_path / "other", "k" * 12, name="elsewhere")
    done = command("compare", run, other)
    assert done.code == 0
    assert "Warning: The runs are of different sequences (circle, elsewhere)" in done.err
    assert "different sequences" in Path("compare.html").read_text()


def test_the_page_cannot_be_written(command: CommandLine, run: Path, tmp_path: Path) -> None:
    Path("page").mkdir()
    for subcommand in (["report", run], ["compare", run, run]):
        done = command(*subcommand, "-o", "page")
        assert done.code == 2
        assert "page is a folder" in done.err
        done = command(*subcommand, "-o", "/proc/page.html")
        assert done.code == 2
        assert "cannot write /proc/page.html" in done.err


def test_a_page_that_cannot_be_made_leaves_the_rest(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("no ink")

    monkeypatch.setattr("orbslam2py.runs.outputs.write_report_page", fail)
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r")
    assert done.code == 1
    assert "cannot make report.html: no ink" in done.err
    assert Path("r/report.json").is_file()
    assert Path("r/trajectory.txt").is_file()


def test_without_the_page(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--no-report")
    assert done.code == 0, done.err
    names = {path.name for path in Path("r").iterdir()}
    assert not names & {"report.html", "frame_images.zip"}
    assert "report.html" not in done.out
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--force")
    assert "report.html" in done.out
    assert {path.name for path in Path("r").iterdir()} > names | {"report.html"}
    command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--force", "--no-report")
    assert {path.name for path in Path("r").iterdir()} == names, "no page of another run"
