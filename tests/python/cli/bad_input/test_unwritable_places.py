# SPDX-License-Identifier: BSD-3-Clause
"""Places that cannot be written: nothing computed is lost."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from orbslam2py import _files
from orbslam2py.trajectory import read_tum
from support.command_line import RUN_FILES, CommandLine, Results
from support.files import names_in
from support.small_disk import small_disk
from support.spoilt_runs import N, run

pytestmark = pytest.mark.watchdog(40)


def test_output_is_a_file(command: CommandLine, rgbd: Path) -> None:
    Path("results").write_text("mine")
    for place in ("results", "results/below"):
        done = command("run", rgbd, "--sensor", "rgbd", "--output", place)
        assert done.code == 2
        assert place in done.err
        assert "--output" in done.err
    assert Path("results").read_text() == "mine"


def test_output_cannot_be_made(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "/proc/results")
    assert done.code == 2
    assert "cannot write to /proc/results" in done.err


def test_no_permission_for_the_output(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Path.write_bytes

    def denied(path: Path, data: bytes) -> int:
        if path.parent.name == "r":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return original(path, data)

    monkeypatch.setattr(Path, "write_bytes", denied)
    done = run(command, rgbd)
    assert done.code == 2
    assert "cannot write to r: Permission denied" in done.err


@pytest.fixture
def rescue(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Folder that stands for the one of temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def fill_disk(monkeypatch: pytest.MonkeyPatch, full: Callable[[Path], bool]) -> None:
    """Let the disk be full when certain files are finished."""
    original = os.fsync

    def fsync(descriptor: int) -> None:
        if full(Path(f"/proc/self/fd/{descriptor}").readlink()):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        original(descriptor)

    monkeypatch.setattr(_files.os, "fsync", fsync)


@pytest.mark.picture
def test_disk_full(
    command: CommandLine, rgbd: Path, rescue: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[Path] = []

    def is_full(path: Path) -> bool:
        if path.parent.name == "r":
            written.append(path)
        return path.parent.name == "r" and len(written) > 1

    fill_disk(monkeypatch, is_full)
    done = run(command, rgbd)
    assert done.code == 1
    assert "Traceback" not in done.err
    (kept,) = rescue.iterdir()
    assert {path.name for path in kept.iterdir()} == RUN_FILES
    assert names_in(Path("r")) == ["frames.csv"], "no halves"
    assert len(Path("r/frames.csv").read_text().splitlines()) == 1
    for name in sorted(RUN_FILES):
        assert f"cannot write r/{name}: No space left on device; kept in" in done.err
        assert f"kept in {kept / name}" in done.err
    assert "Errno" not in done.err
    assert done.err.count("cannot write") == len(RUN_FILES), "each is said once"
    assert len(read_tum(kept / "trajectory.txt")) == N
    assert Results(kept).report["tracked"] == N


def test_disk_full_from_the_beginning(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Told before any image is looked at."""
    fill_disk(monkeypatch, lambda path: path.parent.name == "r")
    done = run(command, rgbd)
    assert done.code == 2
    assert "cannot write to r: No space left on device; give another folder" in done.err
    assert names_in(Path("r")) == []


def test_disk_full_for_one_file(
    command: CommandLine, rgbd: Path, rescue: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_disk(monkeypatch, lambda path: path.name.startswith(".trajectory.txt"))
    done = run(command, rgbd)
    assert done.code == 1
    assert "cannot write r/trajectory.txt" in done.err
    assert "neither in the temporary folder" in done.err
    assert {path.name for path in Path("r").iterdir()} == RUN_FILES - {"trajectory.txt"}


def test_real_full_disk(command: CommandLine, rgbd: Path, rescue: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", "16k") as disk:
        done = command("run", rgbd, "--sensor", "rgbd", "--output", disk)
        written = {path.name for path in disk.iterdir()}
    assert done.code == 1
    assert "No space left on device" in done.err
    kept = {path.name for path in next(rescue.iterdir()).iterdir()}
    assert written | kept == RUN_FILES
    assert "trajectory.png" in kept


@pytest.mark.picture
def test_a_picture_that_cannot_be_drawn(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draw(*_: object, **__: object) -> None:
        raise ValueError("no font")

    monkeypatch.setattr("orbslam2py.runs.run_picture.draw_trajectory", draw)
    done = run(command, rgbd)
    assert done.code == 1
    assert "cannot make trajectory.png: no font" in done.err
    assert {path.name for path in Path("r").iterdir()} == RUN_FILES - {"trajectory.png"}
