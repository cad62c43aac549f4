# SPDX-License-Identifier: BSD-3-Clause
"""Groups of runs that differ only in their seeds: median and range."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Spread:
    """Median and range of a figure over runs."""

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, rows: list[dict[str, Any]], name: str) -> Spread | None:
        """Summarise a figure of all runs that have it; None if none has."""
        found = [float(row[name]) for row in rows if row.get(name) is not None]
        return cls(statistics.median(found), min(found), max(found)) if found else None


@dataclass(frozen=True)
class Group:
    """Runs that differ only in their seeds.

    Attributes
    ----------
    setting
        Their common options.
    n_runs, n_failed
        Their number, and how many of them failed.
    ate_rmse_m, tracked_fraction, frames_per_second, peak_memory_mb
        Median and range of those that did not fail; None if unknown.
    """

    setting: str
    n_runs: int
    n_failed: int
    ate_rmse_m: Spread | None
    tracked_fraction: Spread | None
    frames_per_second: Spread | None
    peak_memory_mb: Spread | None


def summarise(rows: list[dict[str, Any]]) -> list[Group]:
    """Group runs that differ only in their seeds, in the order of their names."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in sorted(rows, key=lambda row: str(row["run"])):
        groups.setdefault(str(row["setting"]), []).append(row)
    found = []
    for setting, members in groups.items():
        done = [row for row in members if row["state"] == "done"]
        spreads = [
            Spread.of(done, name)
            for name in ("ate_rmse_m", "tracked_fraction", "frames_per_second", "peak_memory_mb")
        ]
        found.append(Group(setting, len(members), len(members) - len(done), *spreads))
    return found
