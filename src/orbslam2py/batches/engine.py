# SPDX-License-Identifier: BSD-3-Clause
"""Execution of the runs of a batch: by workers of Dask, on this computer or a cluster."""

from __future__ import annotations

import contextlib
import importlib
import itertools
import queue
import secrets
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from orbslam2py._cores import n_cores
from orbslam2py._version import __version__
from orbslam2py.batches.cache import Cache
from orbslam2py.batches.job import Job
from orbslam2py.batches.results import Results
from orbslam2py.batches.work import failed_row, run_job
from orbslam2py.batches.workers import Workers
from orbslam2py.errors import DatasetError, SettingsError

#: Runs that are handed out per worker at once: no worker waits, and none has a long queue.
_AHEAD = 2
#: A run whose worker failed otherwise than by ending is tried again so often.
_RETRIES = 2
#: Dask counts the end of a worker against all runs that wait there, and gives such up; only the run
#: itself knows how often it was begun (`work.run_job`), so that this is but an end to all.
_MOST_DEATHS = 20
_PATIENCE = 10.0
#: Bytes with which a scheduler may greet: some hundreds say what it is and can.
_LONGEST_GREETING = 1 << 24
#: Seconds between checks whether the batch should stop.
_LOOK_AROUND = 0.5
#: Libraries that would start as many threads as there are cores, in every worker.
_THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


Watch = Callable[[dict[str, str]], None]
"""Gets the present run of each worker."""


def require_dask() -> Any:
    """Import Dask's scheduler.

    Raises
    ------
    SettingsError
        If it is not installed, with the command that installs it.
    """
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise SettingsError(
            "batches run on Dask, which is not installed; install it: "
            "pip install 'orbslam2py[batch]'"
        ) from error


@contextlib.contextmanager
def open_workers(workers: Workers, most: int | None = None) -> Iterator[Any]:
    """Connect to a scheduler, or start one with workers only on this computer.

    Parameters
    ----------
    workers
        Options of the workers.
    most
        Largest number of workers; None for no limit.

    Yields
    ------
    distributed.Client

    Raises
    ------
    DatasetError
        If the scheduler cannot be reached, or its workers have another version of the package.
    """
    distributed = require_dask()
    if workers.scheduler is not None:
        with _client_of(distributed, workers.scheduler) as client:
            _require_version(client, workers.scheduler)
            yield client
        return
    count = workers.count or n_cores()
    if workers.count is not None and most is not None:
        count = min(count, most)
    dask = importlib.import_module("dask")
    limits = dict.fromkeys(_THREAD_LIMITS, "1")
    with dask.config.set(
        {
            "distributed.scheduler.allowed-failures": _MOST_DEATHS,
            "distributed.nanny.pre-spawn-environ": limits,
            "distributed.worker.profile.enabled": False,  # it looks at all threads every 10 ms
            # Its samples are not shown; it would keep two per second for an hour.
            "distributed.admin.system-monitor.log-length": 60,
            # Nor its messages and transitions, with all of the run in each of a thousand.
            "distributed.admin.low-level-log-length": 20,
        }
    ):
        cluster = distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            memory_limit=workers.memory_limit or "auto",
            host="127.0.0.1",
            dashboard_address=None,
            # Any port: for its usual one two batches at a time would contend.
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            silence_logs=50,
        )
        with cluster, distributed.Client(cluster, set_as_default=False) as client:
            client.run(_leave_interrupts_to_the_batch)
            yield client


def run_on(
    client: Any,
    jobs: list[Job],
    results: Results,
    stop: threading.Event,
    *,
    page: bool,
    cache: Cache | None = None,
    watch: Watch | None = None,
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Run jobs, and yield each with its row as it ends.

    Parameters
    ----------
    client
        From `open_workers`.
    jobs
        The jobs.
    results
        The folder of the batch, which all workers see.
    stop
        An event; when it is set, no more runs begin, and the running ones are waited for.
    page
        Write ``report.html`` for every run.
    cache
        Folder for remote sequences, on each worker's computer.
    watch
        Called regularly with the present run of each worker.

    Raises
    ------
    DatasetError
        If the connection to the scheduler is lost.
    """
    waiting = iter(jobs)
    runs = _Handed(client, results, page=page, cache=cache)
    stopped = False
    while True:
        if stop.is_set() and not stopped:
            stopped = True
            results.forbid_beginning()  # those that wait at a worker see it
            runs.take_back()
        while not stopped and runs.n < _AHEAD * runs.n_at_once():
            job = next(waiting, None)
            if job is None:
                break
            runs.hand_over(job)
        if not runs.n:
            break
        if watch is not None and runs.is_time_to_look():
            watch(runs.at_workers())
        ended = runs.next_ended()
        if ended is not None:
            yield ended
    if stopped:
        results.allow_beginning()


class _Handed:
    """Runs that the scheduler has."""

    def __init__(self, client: Any, results: Results, **more: Any) -> None:
        self._client = client
        self._results = results
        self._more = {**more, "session": secrets.token_hex(4)}
        self._running: dict[Any, tuple[Job, int]] = {}
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._n_at_once = 1
        self._counted = self._looked = -_LOOK_AROUND

    @property
    def n(self) -> int:
        return len(self._running)

    def n_at_once(self) -> int:
        """Return how many runs the workers make at once; workers may come and go."""
        if time.monotonic() >= self._counted + _LOOK_AROUND:
            with contextlib.suppress(OSError):  # the scheduler may come back
                self._n_at_once = max(1, sum(self._client.nthreads().values()))
            self._counted = time.monotonic()
        return self._n_at_once

    def is_time_to_look(self) -> bool:
        """Yield True at intervals."""
        if time.monotonic() < self._looked + _LOOK_AROUND:
            return False
        self._looked = time.monotonic()
        return True

    def at_workers(self) -> dict[str, str]:
        """Return the present run of each worker, followed by its waiting runs."""
        jobs = {future.key: job.key for future, (job, _) in self._running.items()}
        with contextlib.suppress(OSError):  # the scheduler may come back
            at = self._client.processing().items()
            mine = {worker: [jobs[key] for key in keys if key in jobs] for worker, keys in at}
            return {worker: names[0] for worker, names in mine.items() if names}
        return {}

    def hand_over(self, job: Job, attempt: int = 0) -> None:
        # The first part alone names a group of runs, which the scheduler keeps its books about.
        name = f"{job.key}-{job.fingerprint}-{attempt}-{self._more['session']}"
        future = self._client.submit(
            run_job, job, self._results, **self._more, key=("run", name), pure=False
        )
        self._running[future] = (job, attempt)
        future.add_done_callback(self._ended.put)

    def take_back(self) -> None:
        """Cancel those that no worker has."""
        at_workers = set(itertools.chain.from_iterable(self._client.processing().values()))
        for future in [one for one in self._running if one.key not in at_workers]:
            del self._running[future]
            future.cancel()

    def next_ended(self) -> tuple[Job, dict[str, Any]] | None:
        """Wait for a run that has ended; None at intervals, and for one that will be repeated."""
        try:
            future = self._ended.get(timeout=_LOOK_AROUND)
        except queue.Empty:
            self._require_scheduler()
            return None
        if future not in self._running:
            return None  # it was taken back
        job, attempt = self._running.pop(future)
        try:
            row = future.result()
        except Exception as error:  # any error that ended the run or the worker
            self._require_scheduler()
            if attempt < (_RETRIES if _is_an_error_of_the_run(error) else _MOST_DEATHS):
                self.hand_over(job, attempt + 1)
                return None
            return job, failed_row(job, _reason(error))
        finally:
            future.release()
        return None if row is None else (job, {sys.intern(name): row[name] for name in row})

    def _require_scheduler(self) -> None:
        if self._client.status in ("closing", "closed"):
            raise DatasetError(
                "the scheduler was lost; start it again, and continue with --resume: finished "
                "runs are kept"
            )


def _is_an_error_of_the_run(error: Exception) -> bool:
    """Return whether the run itself failed, not its worker or the connection."""
    return type(error).__module__.partition(".")[0] not in ("distributed", "concurrent", "asyncio")


def _reason(error: Exception) -> str:
    name = type(error).__name__
    if name == "KilledWorker":
        return (
            "its workers ended again and again before it began: they were killed, or have too "
            "little memory; give more with --memory-limit"
        )
    return f"the worker failed: {_words_of(error)}"


def _words_of(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _greets(scheduler: str) -> bool:
    """Return whether the server at an address answers like a scheduler.

    A scheduler sends first: the length of its message in eight bytes. Dask would interpret the text
    of another program as such a length, and wait for that much data without a limit.
    """
    protocol, _, place = scheduler.rpartition("://")
    host, _, port = place.rstrip("/").rpartition(":")
    if protocol not in ("", "tcp"):
        return True  # Dask knows
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _PATIENCE) as connection:
            connection.settimeout(_PATIENCE)
            greeting = connection.recv(8, socket.MSG_WAITALL)
    except TimeoutError:
        return False
    except OSError:
        return True  # no scheduler answers, which Dask reports
    return len(greeting) == 8 and int.from_bytes(greeting, "little") <= _LONGEST_GREETING


def _client_of(distributed: Any, scheduler: str) -> Any:
    """Connect to a scheduler."""
    remedy = "or leave out --scheduler to work on this computer"
    no_scheduler = (
        f"{scheduler} is no scheduler that can be used: {{}}; give the address that 'dask "
        f"scheduler' prints, {remedy}"
    )
    if not _greets(scheduler):
        raise DatasetError(no_scheduler.format("another program answers there"))
    # Made in two steps: one that fails halfway must be closed, and its constructor hands nothing
    # out to close. Left to itself it ends with a traceback, after 20 s in which nothing happens.
    client = distributed.Client.__new__(distributed.Client)
    try:
        client.__init__(scheduler, timeout=_PATIENCE, set_as_default=False)
    except Exception as error:  # any reply of a program that is no scheduler
        with contextlib.suppress(Exception):
            client.close(timeout=_PATIENCE)
        if isinstance(error, OSError | TimeoutError):
            raise DatasetError(
                f"the scheduler {scheduler} cannot be reached; start one with 'dask scheduler', "
                f"{remedy}"
            ) from error
        says = isinstance(error, ValueError | ImportError)  # of the address, or of versions
        reason = _words_of(error) if says else "another program answers there"
        raise DatasetError(no_scheduler.format(reason)) from error
    return client


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
    """Ignore Ctrl-C, which a terminal sends to all processes; the batch handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
