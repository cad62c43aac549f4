# SPDX-License-Identifier: BSD-3-Clause
"""One run of a batch, in a worker."""

from __future__ import annotations

import logging
import os
import platform
import threading
import time
from pathlib import Path
from typing import Any

import cv2

from orbslam2py._files import describe_error
from orbslam2py._version import __version__
from orbslam2py.batches.cache import DEFAULT_SIZE, Cache, cache_size_of, default_folder
from orbslam2py.batches.job import Job
from orbslam2py.batches.remote import here
from orbslam2py.batches.results import Results
from orbslam2py.batches.sweep import with_parameters
from orbslam2py.errors import DatasetError, OrbSlamError
from orbslam2py.live import open_source
from orbslam2py.runs.report import error_entry, peak_memory_mb
from orbslam2py.runs.run import run_sequence

_log = logging.getLogger(__name__)

#: A run whose worker ended while it was made is begun so often.
_MOST_BEGINNINGS = 3
#: Figures that differ from run to run on one machine: they are last in the table.
MEASURED = (
    *("seconds", "frames_per_second", "slam_frames_per_second", "peak_memory_mb"),
    *("job_seconds", "started", "machine", "worker"),
)
#: Entries of a report that say nothing of the result, or are more than a figure.
_LEFT_OUT = (
    *("sequence", "settings", "options", "command", "command_folder", "machine", "sensor", "seed"),
    *("version", "deterministic", "realtime", "loaded_map", "saved_map", "final_adjustment"),
    "error",  # it is the reason of the row
    *("loops", "losses"),  # they are counted as loops_closed and lost
)


def run_job(
    job: Job,
    results: Results,
    *,
    threads: int = 1,
    page: bool = False,
    cache: Cache | None = None,
    session: str | None = None,
) -> dict[str, Any] | None:
    """Make a run, write its files into a separate folder, and return its row of the table.

    Errors of the run are not raised: the row contains them. Ctrl-C ends the run early, is raised to
    the caller, and the run counts as not made.

    Parameters
    ----------
    job
        The jobs.
    results
        The location of the batch.
    threads
        Threads that OpenCV may use.
    page
        Write ``report.html`` as well.
    cache
        Folder for remote sequences; None: the user's cache.
    session
        Identification of this session: runs with another one were begun by an earlier batch.

    Returns
    -------
    dict or None
        The row; None if the batch is being stopped and the run was not begun.
    """
    cv2.setNumThreads(threads)
    _forget_peak_memory()
    begin = time.perf_counter()
    row = _begun(job)
    try:
        if not results.is_there():  # before it is run for nothing
            where = f"{results.address} is not seen on {platform.node()}"
            return row | {"reason": f"{where}; give an --output that all workers see"}
        if not results.may_begin():
            return None
        if session and results.count_beginning(job.key, session) > _MOST_BEGINNINGS:
            row["reason"] = (
                f"its worker ended {_MOST_BEGINNINGS} times while it ran: it was killed, or had "
                "too little memory; give more with --memory-limit, or run it alone"
            )
        else:
            cache = cache or Cache(default_folder(), cache_size_of(DEFAULT_SIZE))
            with here(job.path, cache) as path, results.of_run(job.key) as folder:
                _run(job, path, folder, row, page=page)
    except (OrbSlamError, OSError, MemoryError) as error:
        row |= {"state": "failed", "reason": _one_line(error)}
    except Exception as error:  # of a library, of a user's own loader, or ours
        _log.error("unexpected error in the run %s", job.key, exc_info=error)
        row |= {"state": "failed", "reason": _one_line(error)}
    row["job_seconds"] = round(time.perf_counter() - begin, 3)
    row.setdefault("seconds", row["job_seconds"])
    row["peak_memory_mb"] = round(peak_memory_mb(), 1)
    _mark_as_ended(results, job, row)
    return row


def _run(job: Job, path: Path, folder: Path, row: dict[str, Any], *, page: bool) -> None:
    """Run the sequence at a path, and put the figures into the row."""
    if not path.exists():
        raise DatasetError(
            f"{job.path} does not exist on {platform.node()}; put the sequences where all "
            "workers see them"
        )
    sequence = open_source(path, job.sensor, settings=job.settings, topics=job.topics)
    if not hasattr(sequence, "timestamps"):
        raise DatasetError(f"{job.path} is a camera; a batch runs recorded sequences")
    if job.parameters:
        changed = with_parameters(sequence.settings, job.parameters)
        sequence = open_source(path, job.sensor, settings=changed, topics=job.topics)
    row["sensor"] = str(sequence.sensor)
    options = job.run_options(sequence.sensor)
    done = run_sequence(
        sequence, options, output=folder, force=True, report_page=page, stop=threading.Event()
    )
    if done.result.interrupted:
        raise KeyboardInterrupt  # the batch repeats the run when it continues
    row |= _figures(done.report)
    row["state"] = "done"
    if done.result.error is not None:
        row |= {"state": "failed", "reason": _one_line(done.result.error)}
    elif done.problems:
        row |= {"state": "failed", "reason": "; ".join(done.problems)}


def failed_row(job: Job, reason: str) -> dict[str, Any]:
    """Return the row of a run whose worker ended."""
    return _begun(job) | {"state": "failed", "reason": reason}


def _mark_as_ended(results: Results, job: Job, row: dict[str, Any]) -> None:
    """Store the row; an error of the disk concerns more than this run."""
    try:
        results.write_row(job.key, row)
    except (OrbSlamError, OSError) as error:
        row |= {"state": "failed", "reason": _one_line(error)}


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
    """Flatten a report: figures, texts, lengths of lists, medians of the times."""
    row: dict[str, Any] = {}
    for name, value in report.items():
        if name in _LEFT_OUT:
            continue
        if name == "milliseconds":
            row |= {f"milliseconds.{stage}": times["median"] for stage, times in value.items()}
        elif name == "imu" and value is not None:
            row["imu.verdict"] = value["verdict"]
        elif isinstance(value, list):
            row[name] = len(value)
        elif value is None or isinstance(value, str | int | float):
            row[name] = value
    return row


def _one_line(error: Exception) -> str:
    # NumPy has its own error for too little memory; users may not know its name.
    text = describe_error(error) if isinstance(error, MemoryError) else error_entry(error)
    return " ".join((text or "").split())


def _forget_peak_memory() -> None:
    """Reset the peak memory of this process, which has made other runs before."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return
