# SPDX-License-Identifier: BSD-3-Clause
"""One run of a batch, where a worker makes it."""

from __future__ import annotations

import json
import os
import platform
import threading
import time
from pathlib import Path
from typing import Any

import cv2

from orbslam2py._files import atomic_write, describe_error
from orbslam2py._version import __version__
from orbslam2py.batches.cache import DEFAULT_SIZE, Cache, bytes_of, default_folder
from orbslam2py.batches.jobs import Job
from orbslam2py.batches.remote import here
from orbslam2py.batches.sweep import with_parameters
from orbslam2py.datasets import open_input
from orbslam2py.errors import DatasetError, OrbSlamError
from orbslam2py.runs.run import run_sequence

#: Marks the folder of a batch.
BATCH_FILE = "batch.json"
#: Marks a folder whose run has ended, and holds its row of the table.
ROW_FILE = "row.json"
#: Figures that differ from run to run on one machine: they are last in the table.
MEASURED = (
    *("seconds", "frames_per_second", "slam_frames_per_second", "peak_memory_mb"),
    *("started", "machine", "worker"),
)
#: Entries of a report that say nothing of the result, or are more than a figure.
_LEFT_OUT = (
    *("sequence", "settings", "options", "command", "command_folder", "machine", "sensor", "seed"),
    *("version", "deterministic", "realtime", "loaded_map", "saved_map", "final_adjustment"),
)


def run_job(
    job: Job, output: str, *, threads: int = 1, page: bool = False, cache: Cache | None = None
) -> dict[str, Any]:
    """Make a run, leave its files in a folder of its own, and return its row of the table.

    Never raises for what is wrong with the run: the row says it.

    Parameters
    ----------
    job
        What to run.
    output
        Folder of the batch.
    threads
        Threads that OpenCV may use.
    page
        Write ``report.html`` as well.
    cache
        Where sequences from elsewhere go; the user's if None.
    """
    folder = Path(output) / "runs" / job.key
    cv2.setNumThreads(threads)
    _forget_peak_memory()
    begin = time.perf_counter()
    row = _begun(job)
    if not (Path(output) / BATCH_FILE).is_file():  # before it is run for nothing
        where = f"{output} is not seen on {platform.node()}"
        return row | {"reason": f"{where}; give an --output that all workers see"}
    try:
        with here(job.path, cache or Cache(default_folder(), bytes_of(DEFAULT_SIZE))) as path:
            _run(job, path, folder, row, page=page)
    except (OrbSlamError, OSError, MemoryError) as error:
        row |= {"state": "failed", "reason": _one_line(error)}
    row.setdefault("seconds", round(time.perf_counter() - begin, 3))
    row["peak_memory_mb"] = _peak_memory() or row.get("peak_memory_mb")
    write_row(folder, row)
    return row


def _run(job: Job, path: Path, folder: Path, row: dict[str, Any], *, page: bool) -> None:
    """Run what is at a path, and put the figures into the row."""
    if not path.exists():
        raise DatasetError(
            f"{job.path} does not exist on {platform.node()}; put the sequences where all "
            "workers see them"
        )
    sequence = open_input(path, job.sensor, settings=job.settings, topics=job.topics)
    if not hasattr(sequence, "timestamps"):
        raise DatasetError(f"{job.path} is a camera; a batch runs recorded sequences")
    if job.parameters:
        changed = with_parameters(sequence.settings, job.parameters)
        sequence = open_input(path, job.sensor, settings=changed, topics=job.topics)
    row["sensor"] = str(sequence.sensor)
    options = job.run_options(sequence.sensor)
    done = run_sequence(
        sequence, options, output=folder, force=True, report_page=page, stop=threading.Event()
    )
    row |= _figures(done.report)
    row["state"] = "done"
    if done.result.error is not None:
        row |= {"state": "failed", "reason": _one_line(done.result.error)}
    elif done.problems:
        row |= {"state": "failed", "reason": "; ".join(done.problems)}


def failed_row(job: Job, reason: str) -> dict[str, Any]:
    """Return the row of a run whose worker ended."""
    return _begun(job) | {"state": "failed", "reason": reason}


def write_row(folder: Path, row: dict[str, Any]) -> None:
    """Mark a folder as finished; a disk that takes nothing more is not the run's failure alone."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_write(folder / ROW_FILE) as stream:
            json.dump(row, stream, indent=2)
    except OSError as error:
        row |= {"state": "failed", "reason": _one_line(error)}


def read_row(output: Path, job: Job) -> dict[str, Any] | None:
    """Return the row of a job that was finished before; None if it has to be run."""
    try:
        row = json.loads((output / "runs" / job.key / ROW_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    finished = isinstance(row, dict) and row.get("state") == "done"
    return row if finished and row.get("fingerprint") == job.fingerprint else None


def _begun(job: Job) -> dict[str, Any]:
    return {
        "run": job.key,
        "sequence": job.name,
        "path": job.path,
        "sensor": job.sensor,
        "settings": job.settings,
        "seed": job.seed,
        **{f"option.{name}": value for name, value in job.options},
        **{f"sweep.{name}": value for name, value in job.parameters},
        "setting": job.setting,
        "fingerprint": job.fingerprint,
        "version": __version__,
        "state": "failed",
        "reason": None,
        "machine": platform.node(),
        "worker": f"{platform.node()}:{os.getpid()}",
    }


def _figures(report: dict[str, Any]) -> dict[str, Any]:
    """Flatten a report: figures, texts, how many entries lists have, medians of the times."""
    row: dict[str, Any] = {}
    for name, value in report.items():
        if name in _LEFT_OUT:
            continue
        if name == "milliseconds":
            row |= {f"milliseconds.{stage}": times["median"] for stage, times in value.items()}
        elif name == "warnings":
            row["warnings"] = len(value)
        elif value is None or isinstance(value, str | int | float):
            row[name] = value
    return row


def _one_line(error: BaseException) -> str:
    return " ".join(describe_error(error).split())


def _forget_peak_memory() -> None:
    """Begin anew with the greatest memory of this process, which has made other runs before."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def _peak_memory() -> float | None:
    try:
        text = Path("/proc/self/status").read_text()
    except OSError:
        return None
    line = next((line for line in text.splitlines() if line.startswith("VmHWM:")), None)
    return None if line is None else round(int(line.split()[1]) / 1e3, 1)
