# SPDX-License-Identifier: BSD-3-Clause
"""A thousand workers by simulation: when the scheduler or a shared disk becomes the limit.

Runs are drawn from a table of runs that were made: seconds on their worker, and megabytes of images
that they read. A run computes and reads at the same time and ends when both are done. All readers
share the disk evenly. The scheduler (and the process of the batch) handles one run after the other,
and gives each worker so many runs beforehand as the engine does.
"""

from __future__ import annotations

import argparse
import csv
import heapq
import random
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from benchmarks.harness.tables import new_table
from orbslam2py.batches.engine import _AHEAD, open_workers, run_on
from orbslam2py.batches.jobs import Job
from orbslam2py.batches.results import Results

_DISKS = (100.0, 1000.0, 10_000.0)
_LENGTHS = (1.0, 10.0, 100.0)
_MEASURED_RUNS = 2000


@dataclass(frozen=True)
class Run:
    """Resources of a run."""

    seconds: float
    megabytes: float


@dataclass(frozen=True)
class Outcome:
    """How a simulated batch went."""

    seconds: float
    ideal: float
    """Seconds of all runs divided by the number of workers."""
    scheduler: float
    """Part of the time in which the scheduler was at work."""
    disk: float
    """Share of the time with at least one reader."""

    @property
    def efficiency(self) -> float:
        return self.ideal / self.seconds


class Disk:
    """Even shares for all readers: what a reader has got grows equally for all of them."""

    def __init__(self, megabytes_per_second: float) -> None:
        self._rate = megabytes_per_second
        self._got = 0.0  # MB, of a reader that was there from the beginning
        self._now = 0.0
        self._readers: list[tuple[float, int]] = []
        self.busy = 0.0

    def advance(self, now: float) -> None:
        if self._readers:
            self._got += (now - self._now) * self._rate / len(self._readers)
            self.busy += now - self._now
        self._now = now

    def begin(self, worker: int, megabytes: float) -> None:
        heapq.heappush(self._readers, (self._got + megabytes, worker))

    def next_end(self) -> float:
        """Time at which the first of the present readers finishes, without new readers."""
        if not self._readers:
            return float("inf")
        left = max(0.0, self._readers[0][0] - self._got)
        return self._now + left * len(self._readers) / self._rate

    def end(self) -> int:
        return heapq.heappop(self._readers)[1]


class Cluster:
    """Workers, a scheduler that serves them one after the other, and a disk."""

    def __init__(self, runs: list[Run], n_workers: int, seconds_per_run: float, disk: Disk) -> None:
        self._waiting = iter(runs)
        self._left = len(runs)
        self._service = seconds_per_run
        self._disk = disk
        self._queues: list[deque[Run]] = [deque() for _ in range(n_workers)]
        self._parts = [0] * n_workers  # of the present run, computing and reading
        self._computing: list[tuple[float, int]] = []
        self._asking = deque(worker for _ in range(_AHEAD) for worker in range(n_workers))
        self._served: tuple[float, int] | None = None
        self._now = 0.0
        self.served_seconds = 0.0

    def play(self) -> float:
        """Seconds until all runs are done."""
        while self._left:
            if self._served is None and self._asking:
                self._served = (self._now + self._service, self._asking.popleft())
            computed = self._computing[0][0] if self._computing else float("inf")
            served = self._served[0] if self._served else float("inf")
            self._now = min(computed, served, self._disk.next_end())
            self._disk.advance(self._now)
            if served <= self._now:
                self._hand_over()
            elif computed <= self._now:
                self._end_part(heapq.heappop(self._computing)[1])
            else:
                self._end_part(self._disk.end())
        return self._now

    def _hand_over(self) -> None:
        assert self._served is not None
        worker, self._served = self._served[1], None
        self.served_seconds += self._service
        run = next(self._waiting, None)
        if run is not None:
            self._queues[worker].append(run)
            if not self._parts[worker]:
                self._begin(worker)

    def _begin(self, worker: int) -> None:
        run = self._queues[worker].popleft()
        self._parts[worker] = 2
        heapq.heappush(self._computing, (self._now + run.seconds, worker))
        self._disk.begin(worker, run.megabytes)

    def _end_part(self, worker: int) -> None:
        self._parts[worker] -= 1
        if self._parts[worker]:
            return
        self._left -= 1
        self._asking.append(worker)
        if self._queues[worker]:
            self._begin(worker)


def simulate(
    runs: list[Run], n_workers: int, seconds_per_run: float, megabytes_per_second: float
) -> Outcome:
    """Make runs in their order.

    Parameters
    ----------
    runs
        Their resources.
    n_workers
        How many there are.
    seconds_per_run
        Of the scheduler.
    megabytes_per_second
        Of the disk, all readers together.
    """
    disk = Disk(megabytes_per_second)
    cluster = Cluster(runs, n_workers, seconds_per_run, disk)
    seconds = cluster.play()
    ideal = sum(run.seconds for run in runs) / n_workers
    return Outcome(seconds, ideal, cluster.served_seconds / seconds, disk.busy / seconds)


def measured_runs(table: Path) -> list[Run]:
    """Runs of a batch's ``results.csv``: their seconds, and the size of what they read."""
    sizes: dict[str, float] = {}
    runs = []
    with table.open(newline="") as stream:
        for row in csv.DictReader(stream):
            if row["state"] == "done":
                path = row["path"]
                if path not in sizes:
                    sizes[path] = _size_mb(Path(path))
                runs.append(Run(float(row["job_seconds"]), sizes[path]))
    return runs


def measured_service(folder: Path) -> float:
    """Seconds that a run takes of the scheduler, the batch and two workers if it does nothing.

    More than what it takes of the scheduler alone: here all of them share the processors.
    """
    nowhere = Results(str(folder / "no batch is here"))
    jobs = [Job(str(folder), "nothing", seed=seed) for seed in range(_MEASURED_RUNS)]
    with open_workers(None, 2, None) as client:
        ended = run_on(client, jobs, nowhere, threading.Event(), page=False)
        next(ended)  # the first load the package
        next(ended)
        begin = time.perf_counter()
        n = sum(1 for _ in ended)
        return (time.perf_counter() - begin) / n


def simulation(arguments: argparse.Namespace, console: Console) -> None:
    """Draw runs, and make them with disks of several speeds and runs of several lengths."""
    runs = measured_runs(arguments.table)
    service = arguments.service or measured_service(arguments.folder)
    draws = random.Random(arguments.seed)
    drawn = draws.choices(runs, k=arguments.jobs)
    mean, read = (
        sum(one) / len(drawn)
        for one in zip(*((r.seconds, r.megabytes) for r in drawn), strict=True)
    )
    table = new_table(
        f"{arguments.jobs} runs on {arguments.workers} workers, {1e3 * service:.2f} ms of the "
        "scheduler for each",
        (),
        (
            *("run s", "reads MB", "disk MB/s", "takes s", "workers used"),
            *("scheduler used", "disk used"),
        ),
        "Runs drawn from those measured, and the same with more frames (seconds and MB times 10, "
        "100).",
    )
    for factor in _LENGTHS:
        scaled = [Run(factor * run.seconds, factor * run.megabytes) for run in drawn]
        for rate in _DISKS:
            outcome = simulate(scaled, arguments.workers, service, rate)
            table.add_row(
                *(f"{factor * mean:.1f}", f"{factor * read:.0f}", f"{rate:.0f}"),
                *(f"{outcome.seconds:.0f}", f"{outcome.efficiency:.0%}"),
                *(f"{outcome.scheduler:.0%}", f"{outcome.disk:.0%}"),
            )
    console.print(table)
    workers = arguments.workers
    console.print(
        f"{workers} workers keep a scheduler busy with runs of {workers * service:.1f} s, and need "
        f"{workers * read / mean:.0f} MB/s of the disk"
    )


def _size_mb(path: Path) -> float:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6
