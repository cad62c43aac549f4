# SPDX-License-Identifier: BSD-3-Clause
"""Play synthetic sequences with and without an IMU, and compare.

python -m benchmarks.inertial --seeds 2
python -m benchmarks.inertial --only "room, shakes" --sensors mono
python -m benchmarks.inertial --faults --seeds 20
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
from benchmarks.inertial import faults
from benchmarks.inertial.cases import CHIPS, SENSORS, SITUATIONS, cases
from benchmarks.inertial.judgement import Row
from benchmarks.inertial.runs import all_rows

_WORST_ROW = 1.05


def geometric_mean(values: Sequence[float]) -> float:
    """Return it; NaN without values."""
    usable = [v for v in values if np.isfinite(v) and v > 0]
    return float(np.exp(np.mean(np.log(usable)))) if usable else float("nan")


def _largest(values: Sequence[float | None], form: str) -> str:
    known = [v for v in values if v is not None]
    return form.format(max(known)) if known else "-"


def show(rows: Sequence[Row], console: Console) -> None:
    """Print a line for each situation, sensor and chip, then the whole."""
    numbers = ["frames", "by IMU", "without", "maps", "ATE [m]", "without", "ratio", "whole [m]"]
    numbers += ["start [s]", "up [deg]", "scale [%]", "bias [sd]", "NEES v, bg, ba"]
    table = new_table("with an IMU", ["situation", "sensor", "chip"], numbers)
    worse = []
    for key in sorted({(r.situation, r.sensor, r.chip) for r in rows}):
        group = [r for r in rows if (r.situation, r.sensor, r.chip) == key]
        ratio = geometric_mean([r.ate / r.ate_without for r in group if r.ate_without > 0])
        if ratio > _WORST_ROW:
            worse.append(f"{', '.join(key)}: {ratio:.2f}")
        nees = [r.nees for r in group if r.nees]
        table.add_row(
            *key,
            f"{sum(r.tracked for r in group)}",
            f"{sum(r.led for r in group)}",
            f"{sum(r.tracked_without for r in group)}",
            f"{sum(r.maps for r in group)}/{sum(r.maps_without for r in group)}",
            f"{np.nanmean([r.ate for r in group]):.4f}",
            f"{np.nanmean([r.ate_without for r in group]):.4f}",
            f"{ratio:.2f}",
            f"{np.nanmean([r.ate_whole for r in group]):.4f}",
            _largest([r.started for r in group], "{:.1f}"),
            _largest([r.up_error for r in group], "{:.2f}"),
            _largest(
                [None if r.scale_error is None else 100 * r.scale_error for r in group], "{:.2f}"
            ),
            _largest([r.bias_error for r in group], "{:.1f}"),
            ", ".join(f"{v:.1f}" for v in np.mean(nees, axis=0)) if nees else "-",
        )
    console.print(table)
    for sensor in sorted({r.sensor for r in rows}):
        of_it = [r for r in rows if r.sensor == sensor]
        ratio = geometric_mean([r.ate / r.ate_without for r in of_it if r.ate_without > 0])
        fewer = sum(r.tracked < r.tracked_without for r in of_it)
        console.print(
            f"{sensor}: ATE {ratio:.3f} times that without the IMU; fewer frames in {fewer} of "
            f"{len(of_it)} runs; false alarms in {sum(bool(r.fault) for r in of_it)}; not started "
            f"in {sum(r.started is None for r in of_it)}"
        )
    console.print(f"rows above {_WORST_ROW}: {'; '.join(worse) or 'none'}")


def write(rows: Sequence[Row], path: Path) -> None:
    """Write all rows as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([one.name for one in dataclasses.fields(Row)])
        for row in rows:
            writer.writerow(dataclasses.astuple(row))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program."""
    parser = new_parser(__doc__)
    add_width(parser, 200)
    add_counts(parser, seeds=(1, "seeds"), jobs=(1, "processes"))
    parser.add_argument("--sensors", nargs="+", choices=SENSORS, default=SENSORS, help="[all]")
    names = [one.name for one in SITUATIONS]
    parser.add_argument("--only", nargs="+", choices=names, default=[], help="situations [all]")
    parser.add_argument("--chips", nargs="+", choices=CHIPS, default=CHIPS, help="IMUs [all]")
    parser.add_argument("--csv", type=Path, help="file for all rows")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="threshold"
    )
    parser.add_argument(
        "--faults",
        nargs="*",
        choices=[one.name for one in faults.FAULTS],
        help="play faults of the IMU on purpose instead [all]",
    )
    arguments = parser.parse_args(argv)
    if arguments.faults is not None:
        told = []
        for result in faults.played(arguments.faults, arguments.sensors, arguments.seeds):
            told.append(result)
            print(result, file=sys.stderr)
        faults.show(told, console_of(arguments))
        return 0
    config = dict(one.split("=", 1) for one in arguments.set)
    rows: list[Row] = []
    chosen = cases(arguments.only, arguments.sensors, arguments.seeds)
    for number, found in enumerate(all_rows(chosen, arguments.chips, arguments.jobs, config), 1):
        rows += found
        one = found[0]
        print(f"{number}/{len(chosen)} {one.situation}, {one.sensor}, {one.seed}", file=sys.stderr)
        if arguments.csv is not None:
            write(rows, arguments.csv)
    show(rows, console_of(arguments))
    return 0


if __name__ == "__main__":
    sys.exit(main())
