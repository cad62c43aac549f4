# SPDX-License-Identifier: BSD-3-Clause
"""All sequences of a standard data set, each sensor, several seeds: a page and a table."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from orbslam2py._arguments import is_whole, path_of, shown
from orbslam2py._files import atomic_write
from orbslam2py.batches.batch import BatchResult, Progress, run_jobs
from orbslam2py.batches.engine import Watch
from orbslam2py.batches.job import Job
from orbslam2py.batches.jobs import options_of
from orbslam2py.batches.results import Results
from orbslam2py.batches.standard_sets.entries import Entry, entries_of
from orbslam2py.batches.standard_sets.find import StandardSet, find_sequences
from orbslam2py.batches.standard_sets.markdown import markdown_table
from orbslam2py.batches.standard_sets.page import benchmark_page
from orbslam2py.batches.workers import Workers
from orbslam2py.datasets import open_sequence
from orbslam2py.errors import DatasetError, OrbSlamError, SettingsError
from orbslam2py.settings import Sensor

PAGE, TABLE = "benchmark.html", "benchmark.md"


@dataclass(frozen=True)
class BenchmarkResult:
    """The result of a benchmark.

    Attributes
    ----------
    kind
        The data set.
    batch
        The runs, and how many remain.
    page, table
        The page, and the same in Markdown.
    """

    kind: StandardSet
    batch: BatchResult
    page: Path
    table: Path

    @property
    def entries(self) -> list[Entry]:
        """Runs of each sequence with each sensor, with published figures."""
        return entries_of(self.kind, self.batch.rows)


def benchmark(
    kind: StandardSet | str,
    root: str | Path,
    output: str | Path,
    *,
    sensors: Sequence[Sensor | str] | None = None,
    seeds: int = 5,
    options: Mapping[str, Any] | None = None,
    resume: bool = False,
    scheduler: str | None = None,
    workers: int | None = None,
    memory_limit: str | None = None,
    report_pages: bool = False,
    progress: Progress | None = None,
    watch: Watch | None = None,
    stop: threading.Event | None = None,
    command: str | None = None,
) -> BenchmarkResult:
    """Run all sequences of a standard data set and compare the results with published figures.

    Parameters
    ----------
    kind
        ``tum``, ``kitti``, ``euroc`` or ``tum-vi``.
    root
        Folder with the sequences, also in its subfolders.
    output
        Folder for the results: those of `batch`, ``benchmark.html`` and ``benchmark.md``.
    sensors
        By default all sensors that a sequence has images for.
    seeds
        Number of runs of each.
    options
        As in a job file, such as ``deterministic`` or ``max_frames``.
    command
        The command line, for the page.
    resume, scheduler, workers, memory_limit, report_pages, progress, watch, stop
        As for `batch`.

    Returns
    -------
    BenchmarkResult
        Also if runs failed or lost tracking: the page says which.

    Raises
    ------
    DatasetError
        If there are no sequences, none has images for the sensors, or the folder cannot be used.
    SettingsError
        If options are invalid.
    OSError
        If a file cannot be written.

    Examples
    --------
    >>> done = orb.batches.benchmark("euroc", "euroc", "runs/euroc")  # doctest: +SKIP
    >>> done.entries[0].spread("ate_rmse_m").median  # doctest: +SKIP
    0.0361
    """
    kind = StandardSet.of(kind)
    if not is_whole(seeds) or seeds < 1:
        raise SettingsError(f"seeds is {shown(seeds)}; give how many runs of each")
    # All that can be is checked before sequences are looked for and opened, which may take long.
    where = Workers.of(scheduler, workers, memory_limit)
    root, folder = path_of(root, "the root"), path_of(output, "output").absolute()
    chosen = None if sensors is None else {Sensor(sensor) for sensor in sensors}
    given = options_of(options or {})
    Results.at(folder).require_free(resume=resume)
    found = find_sequences(kind, root)
    jobs = _jobs(found, chosen, int(seeds), given)
    if not jobs:
        wanted = ", ".join(str(Sensor(sensor)) for sensor in sensors or ())
        raise DatasetError(
            f"none of the {len(found)} sequences in {root} has images for {wanted}; choose another "
            "--sensor"
        )
    done = run_jobs(
        jobs,
        folder,
        where,
        resume=resume,
        report_pages=report_pages,
        progress=progress,
        watch=watch,
        stop=stop,
    )
    entries = entries_of(kind, done.rows)
    files = {
        PAGE: benchmark_page(kind, entries, done, command),
        TABLE: markdown_table(kind, entries),
    }
    for name, text in files.items():
        with atomic_write(folder / name) as stream:
            stream.write(text)
    return BenchmarkResult(kind, done, folder / PAGE, folder / TABLE)


def _jobs(
    found: Mapping[str, Path],
    sensors: set[Sensor] | None,
    seeds: int,
    options: tuple[tuple[str, Any], ...],
) -> list[Job]:
    jobs = []
    for name, path in found.items():
        for sensor in _sensors_of(path, sensors):
            job = Job(str(path.absolute()), name, sensor, options=options)
            jobs += [replace(job, seed=seed) for seed in range(seeds)]
    return jobs


def _sensors_of(path: Path, chosen: set[Sensor] | None) -> Sequence[str | None]:
    try:
        there = getattr(open_sequence(path), "sensors", ())
    except (OrbSlamError, OSError):
        # Its runs fail, and their rows say why.
        return [None] if chosen is None else sorted(map(str, chosen))
    return sorted(str(sensor) for sensor in there if chosen is None or sensor in chosen)
