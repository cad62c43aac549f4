# SPDX-License-Identifier: BSD-3-Clause
"""Play synthetic sequences through lenses, raw pairs and rigs, each beside its reference.

Part lenses: a pinhole with as many pixels per radian in its middle. Part pairs: the rectified pair.
Part rigs: the pair, or the depth camera, to the front.

python -m benchmarks.lenses --seeds 5
python -m benchmarks.lenses --parts rigs --only room --csv build/rigs.csv
"""

from __future__ import annotations

import csv
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table
from benchmarks.lenses.cases import PARTS, cases
from benchmarks.lenses.runs import Row, all_rows


def geometric_mean(rows: Sequence[Row]) -> float:
    """Of the ratios of both errors; NaN without any."""
    ratios = np.array([row.ate / row.ate_reference for row in rows])
    ratios = ratios[np.isfinite(ratios) & (ratios > 0)]
    return float(np.exp(np.mean(np.log(ratios)))) if len(ratios) else float("nan")


def show(rows: Sequence[Row], console: Console) -> None:
    """Print a line for the seeds of each row, then each part."""
    numbers = ["frames", "tracked", "reference", "ATE [m]", "reference", "ratio", "[ms]", "ratio"]
    table = new_table("lenses, pairs and rigs", ["part", "camera", "world", "sensor"], numbers)
    for key in sorted({row.key for row in rows}):
        group = [row for row in rows if row.key == key]
        times = [row.milliseconds / row.milliseconds_reference for row in group]
        table.add_row(
            *key,
            f"{sum(row.frames for row in group)}",
            f"{sum(row.tracked for row in group)}",
            f"{sum(row.tracked_reference for row in group)}",
            f"{np.nanmean([row.ate for row in group]):.4f}",
            f"{np.nanmean([row.ate_reference for row in group]):.4f}",
            f"{geometric_mean(group):.2f}",
            f"{np.median([row.milliseconds for row in group]):.1f}",
            f"{np.median(times):.2f}",
        )
    console.print(table)
    for part in sorted({row.part for row in rows}):
        group = [row for row in rows if row.part == part]
        fewer = sum(row.tracked < row.tracked_reference for row in group)
        console.print(
            f"{part}: ATE {geometric_mean(group):.3f} times that of the reference; fewer frames in "
            f"{fewer} of {len(group)} runs"
        )


def write(rows: Sequence[Row], path: Path) -> None:
    """Write all rows as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([one.name for one in dataclasses.fields(Row)])
        writer.writerows(dataclasses.astuple(row) for row in rows)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program."""
    parser = new_parser(__doc__)
    add_width(parser)
    add_counts(parser, seeds=(1, "seeds"), jobs=(1, "processes"))
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="[all]")
    parser.add_argument("--only", nargs="+", default=[], help="rows with all of these texts")
    parser.add_argument("--csv", type=Path, help="file for all rows")
    arguments = parser.parse_args(argv)
    rows: list[Row] = []
    chosen = [
        case
        for case in cases(arguments.parts, range(1, arguments.seeds + 1))
        if all(text in " ".join(case.row) for text in arguments.only)
    ]
    for number, row in enumerate(all_rows(chosen, arguments.jobs), 1):
        rows.append(row)
        print(f"{number}/{len(chosen)} {', '.join(row.key)}, {row.seed}", file=sys.stderr)
        if arguments.csv is not None:
            write(rows, arguments.csv)
    if not rows:
        parser.error(f"no row has all of {', '.join(arguments.only)}")
    show(rows, console_of(arguments))
    return 0


if __name__ == "__main__":
    sys.exit(main())
