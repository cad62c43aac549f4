# SPDX-License-Identifier: BSD-3-Clause
"""A batch that is killed at random moments and gone on with, against one that is not.

All sequences of the extra data with the sensors they have images for, ten made-up ones, several
seeds, in the deterministic mode. Compared to the byte: the table without its columns of what was
measured (times, memory, machine), and path, keyframes and points of every run.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

import orbslam2py as orb
from benchmarks.batches.made_up import write_sequences
from benchmarks.harness.folders import needed_shared_folder
from orbslam2py.batches.table import is_measured
from orbslam2py.errors import OrbSlamError

_MADE_UP = 10
_WORLDS = ("corridor", "room", "street", "figure-eight", "two-rooms")
_SENSORS = ("rgbd", "stereo", "mono")
#: Files of a run that are promised to the byte.
PROMISED = ("trajectory.txt", "trajectory_online.txt", "keyframes.txt", "points.ply")


def full(arguments: argparse.Namespace, console: Console) -> None:
    """Run both, and compare them."""
    folder: Path = arguments.folder / "full"
    folder.mkdir(parents=True, exist_ok=True)
    jobs = folder / "jobs.yaml"
    jobs.write_text(json.dumps(document(arguments), indent=1))
    seconds = _run(jobs, folder / "undisturbed", arguments)
    rows = _rows(folder / "undisturbed")
    failed = [row for row in rows if row["state"] != "done"]
    console.print(f"undisturbed: {len(rows)} runs, {len(failed)} failed, {seconds:.0f} s")
    for row in failed:
        console.print(f"  {row['run']}: {row['reason']}", highlight=False)
    draws = random.Random(arguments.seed)
    killed = folder / "killed"
    shutil.rmtree(killed, ignore_errors=True)
    for _ in range(arguments.kills):
        moment = draws.uniform(0, seconds)
        _run(jobs, killed, arguments, kill_after=moment)
        ended = len(list(killed.glob("runs/*/row.json")))
        console.print(f"killed after {moment:.1f} s: {ended} of {len(rows)} runs had ended")
    again = _run(jobs, killed, arguments)
    console.print(f"gone on with: {again:.0f} s")
    wrong = differences(folder / "undisturbed", killed)
    for line in wrong:
        console.print(f"[red]differs: {line}", highlight=False)
    size = len(promised_table(killed))
    if wrong:
        sys.exit(1)
    console.print(
        f"The same to the byte: the table ({size} bytes without what was measured) and "
        f"{', '.join(PROMISED)} of {len(rows)} runs"
    )


def document(arguments: argparse.Namespace) -> dict[str, Any]:
    """The job file: each sequence with each of its sensors."""
    made_up = write_sequences(
        arguments.folder / "made-up",
        _MADE_UP,
        arguments.made_up_frames,
        arguments.size,
        sensors=_SENSORS,
        worlds=_WORLDS,
    )
    options: dict[str, Any] = {"deterministic": True}
    if arguments.frames is not None:
        options["max_frames"] = arguments.frames
    sequences = [*_recorded(needed_shared_folder() / "sequences"), *_with_sensors(made_up)]
    return {"sequences": sequences, "options": options, "seeds": arguments.seeds}


def _recorded(folder: Path) -> Iterator[dict[str, str]]:
    return _with_sensors(sorted(path for path in folder.iterdir() if path.is_dir()))


def _with_sensors(paths: list[Path]) -> Iterator[dict[str, str]]:
    for path in paths:
        try:
            sensors = [str(sensor) for sensor in orb.open_sequence(path).sensors]
        except OrbSlamError:  # a folder of images without a calibration: its row says so
            sensors = ["mono"]
        for sensor in sensors:
            yield {"path": str(path), "name": path.name, "sensor": sensor}


def _run(
    jobs: Path, output: Path, arguments: argparse.Namespace, kill_after: float | None = None
) -> float:
    """Start the command, and kill it and its workers after a time; seconds it took.

    What is there already is gone on with.
    """
    command = [sys.executable, "-m", "orbslam2py", "batch", str(jobs), "--output", str(output)]
    command += ["--workers", str(arguments.workers), "--resume", "--quiet"]
    begin = time.perf_counter()
    process = subprocess.Popen(command, start_new_session=True)
    try:
        process.wait(kill_after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    except BaseException:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
        raise
    return time.perf_counter() - begin


def promised_table(folder: Path) -> bytes:
    """``results.csv`` without the columns of what was measured."""
    with (folder / "results.csv").open(newline="") as stream:
        lines = list(csv.reader(stream))
    kept = [i for i, name in enumerate(lines[0]) if not is_measured(name)]
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([line[i] for i in kept] for line in lines)
    return out.getvalue().encode()


def differences(one: Path, other: Path) -> list[str]:
    """Differences of two batches."""
    found = []
    if promised_table(one) != promised_table(other):
        found.append("results.csv")
    for row in _rows(one):
        for name in PROMISED:
            file = Path("runs") / row["run"] / name
            if _content(one / file) != _content(other / file):
                found.append(str(file))
    return found


def _rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "results.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None
