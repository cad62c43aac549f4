# SPDX-License-Identifier: BSD-3-Clause
"""How long the map's lock is held and waited for in whole sequences: lock_times.cpp notes it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.harness import reference
from benchmarks.harness.folders import MISSING, built, how_to_build, sequence_folder, shared_folder
from benchmarks.harness.runs import run_report
from benchmarks.harness.tables import new_table

_LIBRARY = "liblock_times.so"
_EDGES_MS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0)


@dataclass(frozen=True)
class LockTimes:
    """Sections under the map's lock, microseconds."""

    written: np.ndarray
    """(n, 3): waited, held, processor time used while held."""
    read: np.ndarray

    @staticmethod
    def measure(folder: Path, sensor: str, library: Path) -> LockTimes:
        """Run the sequence with the measuring library in front of the C library."""
        with tempfile.TemporaryDirectory() as temporary:
            log = Path(temporary) / "locks.txt"
            noting = {"LD_PRELOAD": str(library.resolve()), "ORBSLAM2PY_LOCK_TIMES": str(log)}
            run_report(folder, sensor, environment=noting)
            rows = [line.split() for line in log.read_text().splitlines()]
        kinds = np.array([row[0] for row in rows])
        times = np.array([row[1:] for row in rows], np.float64).reshape(-1, 3)
        return LockTimes(times[kinds == "w"], times[kinds == "r"])


def lock_tables(build: Path) -> Iterator[object]:
    """Sections of every sequence, by how long they held the lock."""
    missing = how_to_build(build, _LIBRARY) or (MISSING if shared_folder() is None else None)
    if missing is not None:
        yield f"[yellow]Locks: left out, {missing}"
        return
    local, whole = reference.LOCK_HOLD_MS
    table = new_table(
        f"Sections under the map's lock, by milliseconds held (aim: writing {local:g}, a whole map "
        f"{whole:g})",
        ["sequence", ""],
        [
            "n",
            *(f"<{edge:g}" for edge in _EDGES_MS),
            "more",
            "p99",
            "max",
            "max\nused",
            "max\nwait",
        ],
        "Held is wall-clock time: a thread that loses the processor still holds the lock. "
        "Used: processor time\nwhile the lock was held.",
    )
    for figure in reference.SEQUENCES:
        folder = sequence_folder(figure.folder)
        times = LockTimes.measure(folder, figure.sensor, built(build, _LIBRARY))
        for kind, sections in (("writing", times.written), ("reading", times.read)):
            if not len(sections):
                continue
            waited, held, used = (sections / 1e3).T
            bins = np.searchsorted(_EDGES_MS, held, side="right")
            counts = np.bincount(bins, minlength=len(_EDGES_MS) + 1)
            table.add_row(
                figure.name,
                kind,
                str(len(held)),
                *(str(count) for count in counts),
                f"{np.percentile(held, 99):.2f}",
                f"{held.max():.2f}",
                f"{used.max():.2f}",
                f"{waited.max():.2f}",
            )
    yield table
