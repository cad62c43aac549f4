# SPDX-License-Identifier: BSD-3-Clause
"""The table of an ablation: paired differences with 95 % intervals over runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from benchmarks.harness.tables import new_table
from benchmarks.holding_on.results import Row, is_late

_DRAWS = 2000
Floats = NDArray[np.float64]


def _sum_of(name: str) -> Callable[[Row], float]:
    return lambda row: float(row[name])


#: Counts of a run, in the order of the table.
COUNTS: dict[str, Callable[[Row], float]] = {
    "wrong,\nundetected": _sum_of("wrong"),
    "final path\noff": _sum_of("path_off"),
    "not\ntracked": lambda row: float(row["trackable"] - row["tracked"]),
    "losses\nnot found": lambda row: float(row["losses"] - row["found"]),
    "late\nstarts": lambda row: float(is_late(row) or False) if row["sensor"] == "mono" else 0.0,
    "wrong\nstarts": _sum_of("wrong_starts"),
}


def interval(values: Floats, statistic: Callable[[Floats], float] = np.sum) -> tuple[float, float]:
    """95 % interval of a statistic over runs, by the bootstrap (B. Efron, 1979)."""
    random = np.random.default_rng(0)
    draws = [statistic(random.choice(values, len(values))) for _ in range(_DRAWS)]
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(low), float(high)


def ablation_table(
    every: Mapping[str, Mapping[str, Row]], usual: str, cases: Sequence[str], title: str
) -> Table:
    """One line a variant: differences from `usual` over the runs that both have played."""
    table = new_table(title, ["switched off"], ["runs", *COUNTS, "ATE, factor", "spreads"])
    for name, rows in every.items():
        keys = [key for key in cases if key in rows and key in every[usual]]
        if not keys:
            continue
        mine, theirs = [rows[key] for key in keys], [every[usual][key] for key in keys]
        cells = [str(len(keys))]
        for count in COUNTS.values():
            values = np.array([count(row) for row in mine])
            if name == usual:
                cells.append(f"{values.sum():.0f}")
                continue
            difference = values - np.array([count(row) for row in theirs])
            low, high = interval(difference)
            cells.append(f"{difference.sum():+.0f}\n[{low:+.0f}, {high:+.0f}]")
        cells.append("" if name == usual else _ate_factor(mine, theirs))
        cells.append(
            " / ".join(_middle(mine, s) for s in ("rotation_spread", "translation_spread"))
        )
        table.add_row(name, *cells)
    return table


def _ate_factor(mine: Sequence[Row], theirs: Sequence[Row]) -> str:
    logs = [
        math.log(one["ate"] / other["ate"])
        for one, other in zip(mine, theirs, strict=True)
        if one["ate"] > 0 and other["ate"] > 0
    ]
    if not logs:
        return ""
    values = np.array(logs)
    low, high = interval(values, lambda drawn: float(np.mean(drawn)))
    return f"{math.exp(values.mean()):.3f}\n[{math.exp(low):.3f}, {math.exp(high):.3f}]"


def _middle(rows: Sequence[Row], name: str) -> str:
    return f"{np.nanmedian([row[name] for row in rows]):.2f}"
