# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run --save --autosave`` where the disk becomes full: what the file holds is told."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from orbslam2py import Sensor
from orbslam2py.maps import load_map
from orbslam2py.maps.map_writer import MapWriter
from support.command_line import CommandLine, Outcome
from support.small_sequences import N_FAST, write_fast_part

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fast_part(tmp_path_factory.mktemp("sequences") / "lap", Sensor.RGBD)


def full_after(monkeypatch: pytest.MonkeyPatch, n_commits: int) -> None:
    """Let the disk have room for so many commits."""
    original = MapWriter._change
    done: list[None] = []

    def change(self: MapWriter, *arguments: Any) -> int:
        if len(done) >= n_commits:
            raise sqlite3.OperationalError("database or disk is full")
        done.append(None)
        return original(self, *arguments)

    monkeypatch.setattr(MapWriter, "_change", change)


def run(command: CommandLine, sequence: Path, *more: str) -> tuple[Outcome, str]:
    saving = ("--save", "a.orbmap", "--autosave", "0.02")
    done = command("run", sequence, "--sensor", "rgbd", *saving, "--output", "r", *more)
    return done, " ".join(done.out.split())


def report() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(Path("r/report.json").read_text())
    return content


def test_a_file_with_an_older_state_is_told(
    command: CommandLine, sequence: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full_after(monkeypatch, 1)
    done, told = run(command, sequence)
    assert done.code == 1
    n = len(load_map("a.orbmap").runs[-1].frames)
    assert 0 < n < N_FAST
    assert "Map saved" not in told
    assert f"a.orbmap holds an older state of the map, with {n} of {N_FAST} frames" in told
    last = done.err.splitlines()[-1]
    assert last.startswith("Error: cannot write a.orbmap: the disk is full; make room, ")
    assert last.endswith("(the other results are saved)")
    assert report()["saved_map"] is None


@pytest.mark.parametrize("earlier", [False, True])
def test_a_file_that_was_never_written_is_told(
    command: CommandLine, sequence: Path, monkeypatch: pytest.MonkeyPatch, earlier: bool
) -> None:
    if earlier:
        command("run", sequence, "--sensor", "rgbd", "--save", "a.orbmap", "--output", "first")
        before = load_map("a.orbmap").contents
    full_after(monkeypatch, 0)
    done, told = run(command, sequence)
    assert done.code == 1
    assert "Map saved" not in told
    if earlier:
        assert "The map was not saved; a.orbmap is as it was before the run" in told
        assert before.first_difference(load_map("a.orbmap").contents) is None
    else:
        assert "The map was not saved" in told
        assert "as it was" not in told
        assert not Path("a.orbmap").exists()


def test_a_last_save_that_works_is_told_as_ever(command: CommandLine, sequence: Path) -> None:
    done, told = run(command, sequence)
    assert done.code == 0, done.err
    assert "Map saved in a.orbmap" in told
    assert report()["saved_map"] == "a.orbmap"
