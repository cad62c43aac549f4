# SPDX-License-Identifier: BSD-3-Clause
"""Effect of each mechanism beyond the published method.

Each mechanism is switched off through the configuration and the same runs are played: made-up
worlds with hard motions, recorded sequences made harder, and the drive around the block. The
table has differences from the full method, paired by run, with 95 % intervals over runs.
Finished runs are in one CSV file per variant, and are not repeated.

    python -m benchmarks.ablation --runs 300 --jobs 2
    python -m benchmarks.ablation --part recorded --runs 62
    python -m benchmarks.ablation --off "ambiguous places" "keyframes of few inliers" --together
    python -m benchmarks.ablation --set tracking.map_matches=12
"""

from __future__ import annotations

import argparse
import re
from itertools import islice
from pathlib import Path

from benchmarks.ablation.mechanisms import MECHANISMS, Changes, merged
from benchmarks.ablation.table import ablation_table
from benchmarks.harness.arguments import (
    add_counts,
    add_sensors,
    add_width,
    console_of,
    new_parser,
)
from benchmarks.harness.folders import CHECKOUT
from benchmarks.holding_on.__main__ import version
from benchmarks.holding_on.made_up import block_cases, motion_cases
from benchmarks.holding_on.recorded import recorded_cases
from benchmarks.holding_on.results import append_row, read_rows, write_rows
from benchmarks.holding_on.runs import all_rows
from benchmarks.holding_on.scene import Case
from orbslam2py.slam.config import read_change

USUAL = "nothing"


def main() -> None:
    parser = new_parser(__doc__)
    parts = ("motions", "block", "recorded")
    parser.add_argument("--part", choices=parts, default="motions", help="[motions]")
    add_counts(parser, runs=(78, "how many"), jobs=(1, "processes at once"))
    add_sensors(parser)
    parser.add_argument(
        "--only", nargs="+", metavar="TEXT", help="runs with all of these in their name"
    )
    parser.add_argument("--off", nargs="+", choices=MECHANISMS, metavar="NAME", help="[all]")
    parser.add_argument("--together", action="store_true", help="switch these off at once")
    parser.add_argument("--set", nargs="+", metavar="NAME=VALUE", help="any other change, at once")
    parser.add_argument("--folder", type=Path, help="of the CSV files [build/ablation/COMMIT]")
    add_width(parser)
    run(parser.parse_args())


def variants_of(arguments: argparse.Namespace) -> dict[str, Changes]:
    """Return the changes of each variant by its name; the full method is the first."""
    variants: dict[str, Changes] = {USUAL: {}}
    names = arguments.off or ([] if arguments.set else list(MECHANISMS))
    if arguments.together and names:
        variants[" and ".join(names)] = merged(names)
    else:
        variants |= {name: MECHANISMS[name] for name in names}
    if arguments.set:
        variants[", ".join(arguments.set)] = dict(map(read_change, arguments.set))
    return variants


def cases_of(arguments: argparse.Namespace) -> list[Case]:
    if arguments.part == "block":
        return list(block_cases(arguments.runs))
    endless = recorded_cases if arguments.part == "recorded" else motion_cases
    wanted = arguments.only or []
    named = (c for c in endless(arguments.sensors) if all(text in c.key for text in wanted))
    return list(islice(named, arguments.runs))


def run(arguments: argparse.Namespace) -> None:
    console = console_of(arguments)
    folder: Path = arguments.folder or CHECKOUT / "build" / "ablation" / version()
    cases = cases_of(arguments)
    every = {}
    for name, changes in variants_of(arguments).items():
        path = folder / f"{arguments.part}-{re.sub('[^a-z0-9.=]+', '-', name.lower())[:120]}.csv"
        rows = read_rows(path)
        write_rows(path, rows.values())
        missing = [case for case in cases if case.key not in rows]
        for row in all_rows(missing, arguments.jobs, changes):
            rows[row["key"]] = row
            append_row(path, row)
        every[name] = rows
        keys = [case.key for case in cases]
        title = f"{len(cases)} runs of {version()}, {arguments.part}"
        console.print(ablation_table(every, USUAL, keys, title))


if __name__ == "__main__":
    main()
