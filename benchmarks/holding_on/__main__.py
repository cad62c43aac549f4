# SPDX-License-Identifier: BSD-3-Clause
"""Robustness of tracking: undetected wrong poses, starts, losses, consistency of covariances.

Worlds with motions that are hard to follow are played with the three sensors, 400 to 2000
features and new seeds, small and deterministic, and every pose is compared with the truth.
`--part block` drives around 320 m of street with sharp corners, at full size. `--part recorded`
plays the recorded sequences in ways that are harder than they were: every second to fourth image,
backwards, images dropped, blurred, darkened, rolled. `--part images` plays easy motions with more
or less noise, blur and contrast, to compare errors with their stated deviations. Finished runs of
the present code are in the CSV file and are not repeated.

    python -m benchmarks.holding_on --runs 60
    python -m benchmarks.holding_on --runs 1000 --sensors stereo rgbd --jobs 2
    python -m benchmarks.holding_on --part block --runs 10
    python -m benchmarks.holding_on --part recorded --runs 248
    python -m benchmarks.holding_on --part images --runs 108
    python -m benchmarks.holding_on --imu bmi088 --runs 78
"""

from __future__ import annotations

import argparse
import subprocess
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path

from rich.console import Console

from benchmarks.harness.arguments import (
    add_counts,
    add_sensors,
    add_width,
    console_of,
    new_parser,
)
from benchmarks.harness.folders import CHECKOUT
from benchmarks.holding_on.made_up import block_cases, image_cases, motion_cases
from benchmarks.holding_on.recorded import recorded_cases
from benchmarks.holding_on.results import (
    append_row,
    block_table,
    motions_table,
    read_rows,
    write_rows,
)
from benchmarks.holding_on.runs import all_rows
from benchmarks.holding_on.scene import Case
from orbslam2py.settings.imu_presets import IMU_NOISE
from orbslam2py.slam.config import read_change


def version() -> str:
    """The present commit, with a ``+`` if files differ from it."""
    command = ["git", "describe", "--always", "--abbrev=7", "--dirty=+", "--exclude=*"]
    return subprocess.run(
        command, cwd=CHECKOUT, capture_output=True, text=True, check=True
    ).stdout.strip()


def main() -> None:
    parser = new_parser(__doc__)
    parts = ("motions", "block", "recorded", "images")
    parser.add_argument("--part", choices=parts, default="motions", help="[motions]")
    add_counts(parser, runs=(60, "how many"), jobs=(1, "processes at once"))
    add_sensors(parser)
    parser.add_argument("--only", metavar="TEXT", help="runs with this text in their name")
    parser.add_argument("--csv", type=Path, help="file of all runs [build/holding_on/COMMIT.csv]")
    parser.add_argument("--again", action="store_true", help="repeat the runs in the file, too")
    parser.add_argument("--set", nargs="+", metavar="NAME=VALUE", help="configuration", default=[])
    parser.add_argument(
        "--imu", choices=sorted(IMU_NOISE), help="longer runs with this IMU (motions)"
    )
    add_width(parser)
    arguments = parser.parse_args()
    if arguments.imu is not None and arguments.part != "motions":
        parser.error(f"--imu goes with --part motions, not {arguments.part}")
    run(arguments, console_of(arguments))


def run(arguments: argparse.Namespace, console: Console) -> None:
    changes = dict(map(read_change, arguments.set))
    commit = "-".join([version(), *(f"{key}={value}" for key, value in changes.items())])
    path: Path = arguments.csv or CHECKOUT / "build" / "holding_on" / f"{commit}.csv"
    cases = chosen_cases(arguments)
    rows = read_rows(path)
    write_rows(path, rows.values())
    missing = [case for case in cases if arguments.again or case.key not in rows]
    for done, row in enumerate(all_rows(missing, arguments.jobs, changes), 1):
        rows[row["key"]] = row
        append_row(path, row)
        console.print(
            f"{done} of {len(missing)}: {row['key']}: {row['tracked']} of {row['trackable']} "
            f"tracked, {row['wrong']} wrong, {row['seconds']:.1f} s",
            highlight=False,
        )
    present = [rows[case.key] for case in cases]
    table = block_table if arguments.part == "block" else motions_table
    console.print(table(present, f"Holding on, {len(present)} runs of {commit}"))
    console.print(f"All runs: {path}", soft_wrap=True)


def chosen_cases(arguments: argparse.Namespace) -> list[Case]:
    if arguments.part == "block":
        return list(block_cases(arguments.runs))
    kinds = {
        "motions": partial(motion_cases, chip=arguments.imu),
        "recorded": recorded_cases,
        "images": image_cases,
    }
    every: Iterator[Case] = kinds[arguments.part](arguments.sensors)
    if arguments.only is not None:
        every = (case for case in islice(every, 100_000) if arguments.only in case.key)
    return list(islice(every, arguments.runs))


if __name__ == "__main__":
    main()
