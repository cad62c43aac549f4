# SPDX-License-Identifier: BSD-3-Clause
"""Rows of runs in a CSV file, from which an interrupted benchmark continues, and their table."""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from benchmarks.harness.tables import new_table
from benchmarks.holding_on.judgement import Figures
from benchmarks.holding_on.made_up import BLOCK
from benchmarks.holding_on.scene import Case
from orbslam2py._files import atomic_write

Row = dict[str, Any]
_NAMES = [field.name for field in dataclasses.fields(Figures)]
COLUMNS = ["key", "situation", "sensor", "features", "seed", *_NAMES, "options"]
_FIRST_COLUMNS = b"key,situation,sensor,"  # of every version
#: What is asked for.
LATE = 2.0  # seconds after enough parallax


def row_of(case: Case, figures: Figures) -> Row:
    about = {
        "key": case.key,
        "situation": case.situation,
        "sensor": case.sensor,
        "features": case.features,
        "seed": case.seed,
    }
    return {**about, **dataclasses.asdict(figures), "options": case.described()}


def read_rows(path: Path) -> dict[str, Row]:
    """Rows by their keys; none without a file.

    A line that was cut short is left out, and so are those of a version with other figures. Of
    another kind of file the program ends: nothing may be written over it.
    """
    if not path.exists() or (path.is_file() and path.stat().st_size == 0):
        return {}
    if not path.is_file() or not path.read_bytes().startswith(_FIRST_COLUMNS):
        raise SystemExit(f"{path} is no file of runs of this benchmark; give another --csv")
    kinds = {field.name: field.type for field in dataclasses.fields(Figures)}
    rows = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if any(row.get(name) is None for name in COLUMNS) or not row["options"].endswith("}"):
                continue
            numbers = {
                name: float(row[name]) if kinds[name] == "float" else int(row[name])
                for name in _NAMES
            }
            rows[row["key"]] = {**row, **numbers}
    return rows


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write all rows again: a file that was cut short is whole again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def append_row(path: Path, row: Row) -> None:
    with path.open("a", newline="", encoding="utf-8") as file:
        csv.DictWriter(file, COLUMNS).writerow(row)


# ---- tables --------------------------------------------------------------------------------------
def motions_table(rows: Iterable[Row], title: str) -> Table:
    """One line a situation, then one a sensor, and all."""
    table = new_table(
        title,
        ["situation", "sensors"],
        [
            "runs",
            "poses\ncompared",
            "wrong,\nundetected",
            "of these\nkeyframes",
            "the map\nmoved",
            "final path\noff",
            "tracked of\ntrackable",
            "found within\n1 s of losses",
            "place left\nthe view",
            "late\nstarts",
            "wrong\nstarts",
            "rotation\nspread",
            "translation\nspread",
        ],
    )
    rows = [row for row in rows if row["situation"] != BLOCK]
    for name in sorted({row["situation"] for row in rows}):
        some = [row for row in rows if row["situation"] == name]
        sensors = ", ".join(sorted({row["sensor"] for row in some}))
        table.add_row(name, sensors, *line_of(some))
    table.add_section()
    for sensor in sorted({row["sensor"] for row in rows}):
        table.add_row("all", sensor, *line_of([r for r in rows if r["sensor"] == sensor]))
    table.add_row("all", "all", *line_of(rows))
    return table


def line_of(rows: list[Row]) -> list[str]:
    def total(name: str) -> int:
        return sum(row[name] for row in rows)

    begun = [row for row in rows if row["sensor"] == "mono"]
    judged = [is_late(row) for row in begun]
    late = [value for value in judged if value is not None]
    return [
        str(len(rows)),
        str(total("compared")),
        str(total("wrong")),
        str(total("wrong_keyframes")),
        str(total("wrong_before")),
        str(total("path_off")),
        share(total("tracked"), total("trackable")),
        f"{total('found')} of {total('losses')}" if total("losses") else "",
        str(total("left_view")) if total("losses") else "",
        f"{sum(late)} of {len(late)}" if late else "",
        str(total("wrong_starts")) if begun else "",
        middle(row["rotation_spread"] for row in rows),
        middle(row["translation_spread"] for row in rows),
    ]


def share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else ""


def is_late(row: Row) -> bool | None:
    """Whether a single camera began later than 2 s after enough parallax; None: cannot be said.

    There is nothing to say without enough parallax, or if the sequence ended within the 2 s.
    """
    enough, started = row["enough_parallax"], row["started"]
    if math.isnan(enough):
        return None
    if not math.isnan(started):
        return bool(started > enough + LATE)
    return True if enough + LATE <= row["lasted"] else None


def middle(values: Iterable[float]) -> str:
    known = [value for value in values if not math.isnan(value)]
    return f"{np.median(known):.2f}" if known else ""


def block_table(rows: Iterable[Row], title: str) -> Table:
    """One line a run around the block, and the count of those that are good enough."""
    table = new_table(
        title, ["seed"], ["tracked of\nframes", "wrong,\nundetected", "loops", "ATE m", "good"]
    )
    good = 0
    rows = [row for row in rows if row["situation"] == BLOCK]
    for row in rows:
        fine = row["tracked"] == row["frames"] and row["ate"] <= 0.05
        good += fine
        table.add_row(
            str(row["seed"]),
            f"{row['tracked']} of {row['frames']}",
            str(row["wrong"]),
            str(row["loops"]),
            f"{row['ate']:.4f}",
            "yes" if fine else "NO",
        )
    table.caption = f"{good} of {len(rows)}: every frame tracked, and at most 0.05 m"
    return table
