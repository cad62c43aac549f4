# SPDX-License-Identifier: BSD-3-Clause
"""A step beside the reference's, and the table of many."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rich.table import Table

from benchmarks.harness.reference import Figure
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import Measurement


@dataclass(frozen=True)
class Row:
    """A step, measured."""

    name: str
    figure: Figure
    measured: Measurement
    note: str = ""
    stand_in: bool = False
    """Measured on other images than the reference's figure: no verdict."""

    @property
    def verdict(self) -> str:
        """Whether the target is met; empty without one."""
        target = self.figure.target
        if target is None:
            return ""
        return "stand-in" if self.stand_in else verdict(self.measured.carried <= target)


def steps_table(title: str, rows: Iterable[Row]) -> Table:
    """Times here and carried to the reference's machine, beside the reference's and the target."""
    table = new_table(
        title,
        ["step"],
        [
            "here ms\nmedian (min)",
            "yardsticks\nours",
            "there ms\nours",
            "there ms\nreference",
            "yardsticks\nreference",
            "ours /\nreference",
            "there ms\ntarget",
            "met",
        ],
    )
    notes = []
    for row in rows:
        m, theirs, target = row.measured, row.figure.milliseconds, row.figure.target
        table.add_row(
            row.name,
            f"{m.ours.median:.3g} ({m.ours.least:.3g})",
            f"{m.ours.median / m.yardstick.median:.3g}",
            f"{m.carried:.3g}",
            f"{theirs:.4g}" if theirs else "",
            f"{theirs / m.yardstick_there:.3g}" if theirs else "",
            f"{m.carried / theirs:.2f}" if theirs else "",
            f"{target:.3g}" if target else "",
            row.verdict,
        )
        if row.note:
            notes.append(f"{row.name}: {row.note}")
    table.caption = "\n".join(notes) or None
    return table
