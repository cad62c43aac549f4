# SPDX-License-Identifier: BSD-3-Clause
"""Where the runs of a batch are made: in workers of Dask, on this computer or a cluster."""

from __future__ import annotations

import contextlib
import importlib
import os
import queue
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from orbslam2py._version import __version__
from orbslam2py.batches.cache import Cache
from orbslam2py.batches.jobs import Job
from orbslam2py.batches.work import failed_row, run_job
from orbslam2py.errors import DatasetError, SettingsError

#: So many runs a worker are handed out at once: no worker waits, and none has a long queue.
_AHEAD = 2
#: A run whose worker ended is tried again so often.
_RETRIES = 2
_PATIENCE = 10.0
#: Seconds after which it is looked at whether the batch is to be stopped.
_LOOK_AROUND = 0.5
#: Libraries that would start as many threads as there are cores, in every worker.
_THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def require_dask() -> Any:
    """Import Dask's scheduler.

    Raises
    ------
    SettingsError
        If it is not installed, with the line that installs it.
    """
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise SettingsError(
            "batches run on Dask, which is not installed; install it: "
            "pip install 'orbslam2py[batch]'"
        ) from error


@contextlib.contextmanager
def open_workers(
    scheduler: str | None, n_workers: int | None, memory_limit: str | None
) -> Iterator[Any]:
    """Connect to a scheduler, or start one with workers on this computer alone.

    Parameters
    ----------
    scheduler
        Address of a scheduler that runs; None for workers of this batch's own.
    n_workers
        Workers to start; by default one a core.
    memory_limit
        Of each worker, such as ``4GB``; by default an equal part of the computer's.

    Yields
    ------
    distributed.Client

    Raises
    ------
    DatasetError
        If the scheduler cannot be reached, or its workers have another version of the package.
    """
    distributed = require_dask()
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=_PATIENCE, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise DatasetError(
                f"the scheduler {scheduler} cannot be reached; start one with 'dask scheduler', or "
                "leave out --scheduler to work on this computer"
            ) from error
        with client:
            _require_version(client, scheduler)
            yield client
        return
    dask = importlib.import_module("dask")
    limits = dict.fromkeys(_THREAD_LIMITS, "1")
    with dask.config.set(
        {
            "distributed.scheduler.allowed-failures": _RETRIES,
            "distributed.nanny.pre-spawn-environ": limits,
        }
    ):
        cluster = distributed.LocalCluster(
            n_workers=n_workers or _cores(),
            threads_per_worker=1,
            processes=True,
            memory_limit=memory_limit or "auto",
            host="127.0.0.1",
            dashboard_address=None,
            silence_logs=50,
        )
        with cluster, distributed.Client(cluster, set_as_default=False) as client:
            client.run(_leave_interrupts_to_the_batch)
            yield client


def run_on(
    client: Any,
    jobs: list[Job],
    output: Path,
    stop: threading.Event,
    *,
    page: bool,
    cache: Cache | None = None,
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Run jobs, and yield each with its row as it ends.

    Parameters
    ----------
    client
        From `open_workers`.
    jobs
        What to run.
    output
        Folder of the batch, which all workers see.
    stop
        When it is set no more runs begin; those that run are waited for.
    page
        Write ``report.html`` for every run.
    cache
        Where sequences from elsewhere go, on each worker's computer.
    """
    waiting = iter(jobs)
    running: dict[Any, tuple[Job, int]] = {}
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def submit(job: Job, attempt: int) -> None:
        future = client.submit(
            run_job,
            job,
            str(output),
            page=page,
            cache=cache,
            key=f"{job.key}-{job.fingerprint}-{attempt}-{id(running)}",
            pure=False,
        )
        running[future] = (job, attempt)
        future.add_done_callback(ended.put)

    def feed() -> None:
        while not stop.is_set() and len(running) < _AHEAD * _n_workers(client):
            job = next(waiting, None)
            if job is None:
                return
            submit(job, 0)

    feed()
    while running:
        future = _next_ended(ended, client, stop, running)
        if future is None:
            feed()
            continue
        if future not in running:
            continue  # it was cancelled
        job, attempt = running.pop(future)
        error = future.exception() if future.status == "error" else None
        if future.status in ("cancelled", "lost"):
            error = RuntimeError("the scheduler lost the run")
        if error is None:
            yield job, future.result()
        elif attempt < _RETRIES and not stop.is_set():
            submit(job, attempt + 1)
        else:
            yield job, failed_row(job, _reason(error, attempt + 1))
        future.release()
        feed()


def _next_ended(
    ended: queue.SimpleQueue[Any],
    client: Any,
    stop: threading.Event,
    running: dict[Any, tuple[Job, int]],
) -> Any:
    """Wait for a run that has ended; None now and then, to look at `stop` and at the workers."""
    with contextlib.suppress(queue.Empty):
        return ended.get(timeout=_LOOK_AROUND)
    if stop.is_set():
        waiting = [future for future in running if not _is_processing(client, future)]
        for future in waiting:
            del running[future]
            future.cancel()
    return None


def _is_processing(client: Any, future: Any) -> bool:
    processing = client.processing()
    return any(future.key in keys for keys in processing.values())


def _n_workers(client: Any) -> int:
    return max(1, len(client.scheduler_info(n_workers=-1)["workers"]))


def _reason(error: BaseException, attempts: int) -> str:
    name = type(error).__name__
    if name == "KilledWorker":
        return (
            f"its worker ended {attempts} times while it ran: it was killed, or had too little "
            "memory; give more with --memory-limit, or run it alone"
        )
    return f"the worker failed: {' '.join(str(error).split()) or name}"


def _require_version(client: Any, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
        versions: dict[str, str] = client.run(_version_here)
    except TimeoutError as error:
        raise DatasetError(
            f"the scheduler {scheduler} has no workers; start some with 'dask worker {scheduler}'"
        ) from error
    except ImportError as error:
        raise DatasetError(
            f"workers of {scheduler} lack orbslam2py; install version {__version__} there"
        ) from error
    for worker, version in versions.items():
        if version != __version__:
            raise DatasetError(
                f"the worker {worker} has orbslam2py {version}, here it is {__version__}; install "
                "the same version on all computers"
            )


def _version_here() -> str:
    return __version__


def _leave_interrupts_to_the_batch() -> None:
    """Ctrl-C goes to all processes of a terminal; what it means is for the batch to say."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
