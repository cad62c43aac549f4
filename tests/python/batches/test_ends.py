# SPDX-License-Identifier: BSD-3-Clause
"""Batches that are ended from outside: Ctrl-C, a kill at any moment, a full disk."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import Job
from orbslam2py.batches.work import run_job
from support.batches import jobs_of, make_batch, make_sequences, reproducible, table
from support.command_line import CommandLine
from support.small_disk import small_disk

N = 6


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A job file of six runs."""
    folder = tmp_path_factory.mktemp("sequences")
    document = jobs_of(
        make_sequences(folder / "data"),
        seeds=N // 2,
        options={"deterministic": True, "max_frames": 3},
    )
    (folder / "jobs.yaml").write_text(json.dumps(document))
    return folder / "jobs.yaml"


@dataclass(frozen=True)
class Whole:
    """The same batch, undisturbed."""

    folder: Path
    seconds: float
    table: bytes


@pytest.fixture(scope="module")
def whole(jobs: Path, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    folder = tmp_path_factory.mktemp("whole") / "out"
    begin = time.monotonic()
    assert orb.batch(jobs, folder, workers=0).n_failed == 0
    return Whole(folder, time.monotonic() - begin, reproducible(folder))


def start(jobs: Path, output: Path, *options: str) -> subprocess.Popen[str]:
    """Start the command in a group of its own, as a shell does."""
    # Ctrl-C is ignored where the tests run in the background, and who is started inherits that.
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from orbslam2py.cli import main; sys.argv[0] = 'orbslam2py'; main()"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code, "batch", str(jobs), "--output", str(output), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for(condition: Callable[[], bool], is_running: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert is_running()
        assert time.monotonic() < deadline
        time.sleep(0.01)  # for a condition


def finished(folder: Path) -> list[Path]:
    return sorted(folder.glob("runs/*/row.json"))


def require_well_ended(folder: Path, code: int, errors: str) -> None:
    """Runs that were being made ended and are saved; the rest is left for --resume."""
    assert code == 130, errors
    rows = table(folder)
    assert 1 <= len(rows) < N
    assert [row["state"] for row in rows] == ["done"] * len(rows)
    assert len(finished(folder)) == len(rows), "what was begun was ended"
    assert len(list((folder / "runs").iterdir())) == len(rows)
    n_left = N - len(rows)
    left = "1 run is left" if n_left == 1 else f"{n_left} runs are left"
    assert f"{left}; continue with --resume" in errors
    assert "Traceback" not in errors


@pytest.mark.watchdog(150)
def test_interrupted_in_this_process(
    jobs: Path,
    whole: Whole,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "out"
    begun: list[Job] = []

    def interrupted(job: Job, *rest: Any, **named: Any) -> Any:
        begun.append(job)
        if len(begun) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return run_job(job, *rest, **named)

    # Not by its name: the function `batch` hides the module.
    monkeypatch.setattr(sys.modules["orbslam2py.batches.batch"], "run_job", interrupted)
    command = CommandLine(monkeypatch, capsys, tmp_path)
    done = command("batch", jobs, "--output", folder, "--workers", 0)
    require_well_ended(folder, done.code, done.err)
    assert len(table(folder)) == 2
    done = command("batch", jobs, "--output", folder, "--workers", 0, "--resume")
    assert done.code == 0
    assert len(begun) == N, "none was made twice"
    assert reproducible(folder) == whole.table


def test_what_ended_when_it_was_taken_back_is_in_the_table(
    jobs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, stop = tmp_path / "out", threading.Event()

    def taken_back(job: Job, *rest: Any, **named: Any) -> Any:
        row = run_job(job, *rest, **named)
        if len(finished(folder)) < 2:
            return row
        stop.set()
        return None

    monkeypatch.setattr(sys.modules["orbslam2py.batches.batch"], "run_job", taken_back)
    done = orb.batch(jobs, folder, workers=0, stop=stop)
    assert (len(done.rows), done.n_left) == (2, N - 2)
    assert len(table(folder)) == len(finished(folder)) == 2


@pytest.mark.watchdog(150)
def test_interrupted(jobs: Path, tmp_path: Path) -> None:
    """Ctrl-C as a terminal sends it, to the command and all its workers."""
    pytest.importorskip("distributed", reason="dask is an extra")
    folder = tmp_path / "out"
    process = start(jobs, folder, "--workers", "2")
    wait_for(lambda: bool(finished(folder)), lambda: process.poll() is None)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=100)
    require_well_ended(folder, process.returncode, errors)


@pytest.mark.watchdog(300)
def test_killed_at_any_moment(jobs: Path, whole: Whole, tmp_path: Path) -> None:
    """Killed on the way and gone on with: the table of one that was not, to the byte."""
    draws = random.Random(14)
    # Processes that have loaded the package before they are told what to do.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([run_job.__module__, "matplotlib.backends.backend_agg"])
    for number in range(2):
        folder = tmp_path / str(number)
        process = context.Process(target=make_batch, args=(jobs, folder))
        process.start()
        wait_for((folder / "batch.json").exists, process.is_alive)
        process.join(draws.uniform(0, whole.seconds))  # the moment
        process.kill()
        process.join()
        process.close()
        kept = {path: path.stat().st_mtime_ns for path in finished(folder)}
        done = orb.batch(jobs, folder, workers=0, resume=True)
        assert (len(done.rows), done.n_failed, done.n_left) == (N, 0, 0)
        assert {path: path.stat().st_mtime_ns for path in kept} == kept, "none was run again"
        assert reproducible(folder) == whole.table
        for row in done.rows:
            for name in ("trajectory.txt", "points.ply", "keyframes.txt"):
                file = f"runs/{row['run']}/{name}"
                assert (folder / file).read_bytes() == (whole.folder / file).read_bytes()


@pytest.fixture
def rescue(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Folder that stands for the one of temporary files."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


@pytest.mark.picture
@pytest.mark.watchdog(150)
def test_full_disk(jobs: Path, whole: Whole, tmp_path: Path, rescue: Path) -> None:
    """Results that do not fit are kept elsewhere, and runs are made again where there is room."""
    with small_disk(tmp_path / "disk", "300k") as disk:
        with pytest.raises(OSError, match=r"cannot write .*results\.csv: No space left on device"):
            orb.batch(jobs, disk / "out", workers=0)
        assert any(rescue.iterdir())
        subprocess.run(["mount", "-o", "remount,size=60m", str(disk)], check=True)
        done = orb.batch(jobs, disk / "out", workers=0, resume=True)
        assert (len(done.rows), done.n_failed) == (N, 0)
        assert reproducible(disk / "out") == whole.table
