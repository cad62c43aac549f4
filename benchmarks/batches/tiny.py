# SPDX-License-Identifier: BSD-3-Clause
"""Thousands of tiny runs: whether memory grows, and how much of the workers' time is theirs."""

from __future__ import annotations

import argparse
import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console

import orbslam2py as orb
from benchmarks.batches.made_up import write_sequences
from benchmarks.harness.process_memory import resident_mb
from benchmarks.harness.tables import in_words, new_table

#: Wall time over the sum of the runs' own times divided by the number of workers.
MOST_OF_OWN_TIME = 1.3
#: The batch keeps the row of every run, which is what its table is made of.
MOST_KB_PER_RUN = 10.0
#: Workers may keep what a library caches, but nothing of every run.
MOST_KB_PER_RUN_OF_WORKER = 1.0
#: Runs until every buffer has once had its largest size.
_WARM = 90
_SEQUENCES = 10
_FRAMES = 30
_SIZE = (160, 120)
_LINES = 10


@dataclass
class Watch:
    """Measurements after each run."""

    begin: float = field(default_factory=time.perf_counter)
    own: list[float] = field(default_factory=list)
    lines: list[tuple[int, float, float, float]] = field(default_factory=list)
    """Runs, seconds, MB of the batch and the scheduler, MB of the largest worker."""
    _workers: dict[str, float] = field(default_factory=dict)

    def __call__(self, row: dict[str, Any], done: int, total: int) -> None:
        self.own.append(float(row["job_seconds"]))
        self._workers[str(row["worker"])] = float(row["peak_memory_mb"])
        if done % max(1, total // _LINES) == 0 or done == total:
            seconds = time.perf_counter() - self.begin
            here = resident_mb(trimmed=True)
            self.lines.append((done, seconds, here, max(self._workers.values())))


def tiny(arguments: argparse.Namespace, console: Console) -> None:
    """Run them."""
    paths = write_sequences(arguments.folder / "tiny", _SEQUENCES, _FRAMES, _SIZE)
    document = {
        "sequences": [str(path) for path in paths],
        "options": {"deterministic": True},
        "seeds": max(1, arguments.jobs // _SEQUENCES),
    }
    folder: Path = arguments.folder / "tiny-runs"
    shutil.rmtree(folder, ignore_errors=True)
    watch = Watch()
    done = orb.batch(document, folder, workers=arguments.workers, progress=watch)
    wall = time.perf_counter() - watch.begin
    table = new_table(
        f"{len(done.rows)} runs of {_FRAMES} frames, {arguments.workers} workers",
        (),
        ("runs", "seconds", "batch and scheduler MB", "largest worker MB"),
    )
    for n, seconds, here, there in watch.lines:
        table.add_row(str(n), f"{seconds:.0f}", f"{here:.1f}", f"{there:.1f}")
    console.print(table)
    if done.n_failed:
        console.print(f"[red]{done.n_failed} failed: {done.rows[0]['reason']}")
    ideal = sum(watch.own) / arguments.workers
    ratio = wall / ideal
    console.print(
        f"{wall:.1f} s for {ideal:.1f} s of their own on each worker: {ratio:.2f} "
        f"(goal {MOST_OF_OWN_TIME}: {in_words(ratio <= MOST_OF_OWN_TIME)}); with the table, and "
        "with starting and ending the workers"
    )
    for column, name, most in (
        (2, "batch and scheduler", MOST_KB_PER_RUN),
        (3, "largest worker", MOST_KB_PER_RUN_OF_WORKER),
    ):
        growth = growth_kb(watch.lines, column)
        console.print(
            f"{name}: {growth:.2f} kB a run after the first {_WARM} or the first tenth "
            f"(goal {most:g}: {in_words(growth <= most)})"
        )


def growth_kb(lines: list[tuple[int, float, float, float]], column: int) -> float:
    """kB a run between the first line of warm programs and the last."""
    first, last = next((line for line in lines if line[0] >= _WARM), lines[0]), lines[-1]
    if last[0] == first[0]:
        return 0.0
    return 1e3 * (last[column] - first[column]) / (last[0] - first[0])
