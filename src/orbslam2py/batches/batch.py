# SPDX-License-Identifier: BSD-3-Clause
"""Many runs, one table: on all cores of this computer, or on a cluster."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbslam2py._arguments import path_of
from orbslam2py.batches.cache import DEFAULT_SIZE, Cache, cache_size_of, default_folder
from orbslam2py.batches.engine import Watch, open_workers, require_dask, run_on
from orbslam2py.batches.job import Job
from orbslam2py.batches.jobs import make_jobs, read_jobs
from orbslam2py.batches.results import Results
from orbslam2py.batches.summary import Group, summarise
from orbslam2py.batches.sweep_picture import write_sweep_picture
from orbslam2py.batches.table import write_table
from orbslam2py.batches.work import run_job
from orbslam2py.batches.workers import Workers
from orbslam2py.errors import DatasetError

Progress = Callable[[dict[str, Any], int, int], None]

#: Error against each parameter of a sweep.
PICTURE = "sweep.png"


@dataclass(frozen=True)
class BatchResult:
    """The result of a batch.

    Attributes
    ----------
    folder
        The folder of the table and the runs; its address if it is remote.
    rows
        The rows of the table, one dictionary for each run.
    n_left
        Number of runs that were not made because the batch was stopped.
    files
        The files of the table, and the picture of a sweep.
    """

    folder: Path | str
    rows: list[dict[str, Any]]
    n_left: int
    files: list[Path] | list[str]

    @property
    def groups(self) -> list[Group]:
        """Runs that differ only in their seeds, with median and range."""
        return summarise(self.rows)

    @property
    def n_failed(self) -> int:
        """How many runs failed."""
        return sum(row["state"] != "done" for row in self.rows)


def batch(
    jobs: str | Path | Mapping[str, Any],
    output: str | Path | None = None,
    *,
    resume: bool = False,
    scheduler: str | None = None,
    workers: int | None = None,
    memory_limit: str | None = None,
    report_pages: bool = False,
    cache: str | Path | None = None,
    cache_size: str | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
    stop: threading.Event | None = None,
) -> BatchResult:
    """Run many sequences with many settings and seeds, and write one table of all runs.

    Parameters
    ----------
    jobs
        A job file (YAML), or a dictionary with the same keys.
    output
        Folder for the results, or an address for fsspec such as ``s3://bucket/night``; by default
        the ``output`` in the job file.
    resume
        Continue in a folder with results: finished runs are not repeated.
    scheduler
        Address of a running Dask scheduler (``tcp://HOST:PORT``); by default workers are started on
        this computer.
    workers
        Number of workers to start; by default one per core. 0: run in this process, one after the
        other.
    memory_limit
        Limit for each started worker, such as ``4GB``, at least 500 MB; by default an equal share
        of the computer's memory. Not used with a `scheduler`, nor without workers.
    report_pages
        Write ``report.html`` for every run.
    cache
        Folder for remote sequences (``s3://``, ``https://``, zip and tar files), on each worker's
        computer; by default in the user's cache.
    cache_size
        Largest size of this folder; the default is ``20GB``.
    progress
        Called after each run with its row, the number of ended runs, and the number of all runs.
    watch
        Called regularly with a dictionary: the present run of each worker.
    stop
        An event; when it is set, no more runs begin, and the batch waits for the running ones.

    Returns
    -------
    BatchResult
        Also if runs failed: their rows contain the reason.

    Raises
    ------
    SettingsError
        If the jobs or options are wrong, or Dask is not installed. Nothing is written then.
    DatasetError
        If a sequence is missing, the folder cannot be used, or the scheduler cannot be reached.
    OSError
        If the table cannot be written.

    Examples
    --------
    >>> done = orb.batch({"sequences": ["lap"], "seeds": 5}, "runs/laps")  # doctest: +SKIP
    >>> done.groups[0].ate_rmse_m.median  # doctest: +SKIP
    0.0112
    """
    where = Workers.of(scheduler, workers, memory_limit)
    kept = Cache(
        default_folder() if cache is None else path_of(cache, "the cache").absolute(),
        cache_size_of(DEFAULT_SIZE if cache_size is None else cache_size),
    )
    elsewhere = where.scheduler is not None
    if isinstance(jobs, Mapping):
        wanted = make_jobs(jobs, elsewhere=elsewhere)
        named = jobs.get("output")
    else:
        wanted, named = read_jobs(path_of(jobs, "the job file"), elsewhere=elsewhere)
    place = named if output is None else output
    if place is None:
        raise DatasetError("there is no folder for the results; give --output")
    return run_jobs(
        wanted,
        place,
        where,
        resume=resume,
        report_pages=report_pages,
        cache=kept,
        progress=progress,
        watch=watch,
        stop=stop,
    )


def run_jobs(
    wanted: list[Job],
    place: str | Path,
    workers: Workers,
    *,
    resume: bool = False,
    report_pages: bool = False,
    cache: Cache | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
    stop: threading.Event | None = None,
) -> BatchResult:
    """Run prepared jobs; see `batch`."""
    results = Results.at(place)
    results.require_free(resume=resume)
    rows = results.rows_of(wanted) if resume else {}
    left = [job for job in wanted if job.key not in rows]
    stop = stop or threading.Event()
    with _begun(results, workers, len(left)) as client:
        for job, row in _ended(
            *(left, results, stop, client), page=report_pages, cache=cache, watch=watch
        ):
            rows[job.key] = row
            if progress is not None:
                progress(row, len(rows), len(wanted))
    if stop.is_set():
        # A run may have ended just when it was taken back.
        rows |= results.rows_of([job for job in left if job.key not in rows])
    table = [rows[job.key] for job in wanted if job.key in rows]
    with results.table() as folder:
        files = write_table(folder, table)
        if write_sweep_picture(folder / PICTURE, table):
            files.append(folder / PICTURE)
    n_left = len(wanted) - len(table)
    if results.folder is not None:
        return BatchResult(results.folder, table, n_left, files)
    addresses = [f"{results.address}/{file.name}" for file in files]
    return BatchResult(results.address, table, n_left, addresses)


@contextlib.contextmanager
def _begun(results: Results, workers: Workers, n_jobs: int) -> Iterator[Any]:
    """Make the folder of the batch, and start the workers that it needs; None if it needs none."""
    if workers.is_this_process or not n_jobs:
        results.begin()
        yield None
        return
    require_dask()
    if workers.scheduler is None:
        results.begin()  # workers would be started in vain if it cannot be written
    with open_workers(workers, most=n_jobs) as client:
        if workers.scheduler is not None:
            results.begin()  # a scheduler that cannot be reached leaves nothing behind
        yield client


def _ended(
    jobs: list[Job],
    results: Results,
    stop: threading.Event,
    client: Any,
    *,
    page: bool,
    cache: Cache | None,
    watch: Watch | None,
) -> Iterator[tuple[Job, dict[str, Any]]]:
    if client is not None:
        yield from run_on(client, jobs, results, stop, page=page, cache=cache, watch=watch)
        return
    for job in jobs:
        if stop.is_set():
            return
        if watch is not None:
            watch({"here": job.key})
        if (row := run_job(job, results, page=page, cache=cache)) is not None:
            yield job, row
