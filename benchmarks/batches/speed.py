# SPDX-License-Identifier: BSD-3-Clause
"""What several workers gain, and what the engine takes of a run."""

from __future__ import annotations

import argparse
import shutil
import statistics
import time
from pathlib import Path
from typing import Any

from rich.console import Console

import orbslam2py as orb
from benchmarks.batches.made_up import write_sequences
from benchmarks.harness.tables import in_words, new_table, verdict

#: Wall time of two workers over that of one run after the other.
MOST_OF_ONE_AFTER_THE_OTHER = 0.6
#: Time that the engine takes, over that of a run of 30 s.
MOST_OVERHEAD = 0.02
RUN_SECONDS = 30.0


def run_batch(document: dict[str, Any], folder: Path, workers: int) -> tuple[float, list[float]]:
    """Run a batch from the start.

    Returns
    -------
    wall, own
        Seconds from its begin to its end, and of each run on its worker.
    """
    shutil.rmtree(folder, ignore_errors=True)
    begin = time.perf_counter()
    done = orb.batch(document, folder, workers=workers)
    wall = time.perf_counter() - begin
    if done.n_failed:
        raise RuntimeError(next(row["reason"] for row in done.rows if row["state"] != "done"))
    return wall, [float(row["job_seconds"]) for row in done.rows]


def two_cores(arguments: argparse.Namespace, console: Console) -> None:
    """The same sequences one after the other, and on several workers."""
    paths = write_sequences(
        arguments.folder / "sequences", arguments.sequences, arguments.frames, arguments.size
    )
    table = new_table(
        f"{len(paths)} sequences of {arguments.frames} frames, {arguments.workers} workers",
        ("mode",),
        ("one after the other s", "batch s", "ratio", "goal", "met"),
        "With starting and ending the workers of the batch.",
    )
    for deterministic in (True, False):
        document = {
            "sequences": [str(path) for path in paths],
            "options": {"deterministic": deterministic},
        }
        alone, _ = run_batch(document, arguments.folder / "alone", 0)
        together, _ = run_batch(document, arguments.folder / "together", arguments.workers)
        ratio = together / alone
        table.add_row(
            "deterministic" if deterministic else "with threads",
            *(f"{alone:.1f}", f"{together:.1f}", f"{ratio:.2f}"),
            f"{MOST_OF_ONE_AFTER_THE_OTHER}",
            verdict(ratio <= MOST_OF_ONE_AFTER_THE_OTHER),
        )
    console.print(table)


def overhead(arguments: argparse.Namespace, console: Console) -> None:
    """Long runs in this process and on one worker, in turns."""
    (path,) = write_sequences(arguments.folder / "long", 1, arguments.frames, arguments.size)
    document = {
        "sequences": [str(path)],
        "options": {"deterministic": True},
        "seeds": arguments.seeds,
    }
    here, there, between, starts = [], [], [], []
    for _ in range(arguments.rounds):
        # The first run of a process loads what later ones have.
        _, own = run_batch(document, arguments.folder / "here", 0)
        here += own[1:]
        wall, own, gaps = _watched(document, arguments.folder / "there")
        there += own[1:]
        between += gaps[1:]
        starts.append(wall - len(own) * statistics.median(own[1:]) - sum(gaps[1:]))
    run, on_worker = statistics.median(here), statistics.median(there)
    gap = statistics.fmean(between or [0.0])
    taken = (on_worker - run + gap) / run
    console.print(
        f"A run takes {run:.2f} s in this process ({min(here):.2f} to {max(here):.2f}), "
        f"{on_worker:.2f} s on a worker ({min(there):.2f} to {max(there):.2f}), and "
        f"{1e3 * gap:.1f} ms pass between two: {100 * taken:.2f} % of it"
    )
    of_thirty = (max(on_worker - run, 0.0) * RUN_SECONDS / run + gap) / RUN_SECONDS
    console.print(
        f"Of a run of {RUN_SECONDS:.0f} s {100 * of_thirty:.2f} % (goal {100 * MOST_OVERHEAD:.0f} %"
        f": {in_words(of_thirty <= MOST_OVERHEAD)}). Once a batch, to start and to end the worker: "
        f"{statistics.median(starts):.1f} s, with what its first run loads"
    )


def _watched(document: dict[str, Any], folder: Path) -> tuple[float, list[float], list[float]]:
    """One worker: wall time, own times in the order of the runs, and seconds between their ends
    that are of no run."""
    shutil.rmtree(folder, ignore_errors=True)
    ends: list[tuple[float, float]] = []

    def progress(row: dict[str, Any], done: int, total: int) -> None:
        ends.append((time.perf_counter(), float(row["job_seconds"])))

    begin = time.perf_counter()
    done = orb.batch(document, folder, workers=1, progress=progress)
    wall = time.perf_counter() - begin
    if done.n_failed:
        raise RuntimeError(done.rows[0]["reason"])
    # A row is noticed a little after its end, or after the next run has begun: single gaps may be
    # negative, their mean is not.
    gaps, before = [], begin
    for end, own in ends:
        gaps.append(end - before - own)
        before = end
    return wall, [own for _, own in ends], gaps
