# SPDX-License-Identifier: BSD-3-Clause
"""How a single camera's maps begin on recorded sequences.

Each recording is played from five first images with many seeds. A start is wrong if the path of a
map's first 30 frames, aligned by Sim(3), is off by more than a tenth of its length; it is late if
it comes more than 2 s after two views within a second show enough parallax. Both are those of
`benchmarks.holding_on`. Finished runs are in the CSV file and are not repeated.

    python -m benchmarks.starts --seeds 20
    python -m benchmarks.starts --seeds 12 --only desk
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import CHECKOUT
from benchmarks.harness.tables import new_table
from benchmarks.holding_on.__main__ import version
from benchmarks.holding_on.results import Row, append_row, is_late, read_rows, write_rows
from benchmarks.holding_on.runs import all_rows
from benchmarks.starts.cases import start_cases
from orbslam2py.slam.config import read_change


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(parser, seeds=(20, "of each start"), jobs=(1, "processes at once"))
    parser.add_argument("--only", metavar="TEXT", help="recordings with this text in their name")
    parser.add_argument("--csv", type=Path, help="file of all runs [build/starts/COMMIT.csv]")
    parser.add_argument("--set", nargs="+", metavar="NAME=VALUE", help="configuration", default=[])
    add_width(parser)
    run(parser.parse_args())


def run(arguments: argparse.Namespace) -> None:
    console = console_of(arguments)
    changes = dict(map(read_change, arguments.set))
    name = "-".join([version(), *(f"{key}={value}" for key, value in changes.items())])
    path: Path = arguments.csv or CHECKOUT / "build" / "starts" / f"{name}.csv"
    cases = list(start_cases(arguments.seeds, arguments.only))
    rows = read_rows(path)
    write_rows(path, rows.values())
    missing = [case for case in cases if case.key not in rows]
    for row in all_rows(missing, arguments.jobs, changes):
        rows[row["key"]] = row
        append_row(path, row)
    present = [rows[case.key] for case in cases]
    console.print(starts_table(present, f"{len(present)} starts of {version()}"))


def starts_table(rows: list[Row], title: str) -> Table:
    """One line a recording, and all."""
    columns = ["runs", "begun", "late", "wrong", "ATE, median", "ATE, worst"]
    table = new_table(title, ["recording"], columns)
    for name in sorted({row["situation"] for row in rows}):
        table.add_row(name, *_cells([row for row in rows if row["situation"] == name]))
    table.add_section()
    table.add_row("all", *_cells(rows))
    return table


def _cells(rows: list[Row]) -> list[str]:
    judged = [late for row in rows if (late := is_late(row)) is not None]
    errors = [row["ate"] for row in rows if np.isfinite(row["ate"])]
    return [
        str(len(rows)),
        str(sum(bool(np.isfinite(row["started"])) for row in rows)),
        f"{sum(judged)} of {len(judged)}",
        str(sum(row["wrong_starts"] for row in rows)),
        f"{np.median(errors):.4f}" if errors else "",
        f"{max(errors):.4f}" if errors else "",
    ]


if __name__ == "__main__":
    main()
