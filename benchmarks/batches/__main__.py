# SPDX-License-Identifier: BSD-3-Clause
"""Batches: what several workers gain, what the engine takes, and that nothing is lost by a kill.

    python -m benchmarks.batches two-cores      20 sequences, one after the other and not
    python -m benchmarks.batches overhead       what the engine takes of a run
    python -m benchmarks.batches tiny           10 000 runs of 30 frames
    python -m benchmarks.batches simulation     1000 workers and 100 000 runs, from a results.csv
    python -m benchmarks.batches full           killed and gone on with: the same table

How fast bags are read is measured by `python -m benchmarks.speed.bags`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.batches.full import full
from benchmarks.batches.simulation import simulation
from benchmarks.batches.speed import overhead, two_cores
from benchmarks.batches.tiny import tiny
from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import CHECKOUT


def _size(text: str) -> tuple[int, int]:
    width, height = map(int, text.split("x"))
    return width, height


def _with_size(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--size", type=_size, default=_size(default), metavar="WxH", help=f"[{default}]"
    )


def parse() -> argparse.Namespace:
    parser = new_parser(__doc__)
    parser.add_argument(
        "--folder",
        type=Path,
        default=CHECKOUT / "build" / "batches",
        help="for sequences and results [build/batches]",
    )
    add_width(parser)
    parts = parser.add_subparsers(metavar="PART", required=True)
    part = parts.add_parser("two-cores", help="several workers against one after the other")
    add_counts(part, sequences=(20, "how many"), frames=(300, "of each"), workers=(2, "how many"))
    _with_size(part, "320x240")
    part.set_defaults(run=two_cores)
    part = parts.add_parser("overhead", help="what the engine takes of a run")
    add_counts(part, frames=(900, "of the run"), seeds=(3, "runs, from 2"), rounds=(3, "of all"))
    _with_size(part, "640x480")
    part.set_defaults(run=overhead)
    part = parts.add_parser("tiny", help="thousands of short runs")
    add_counts(part, jobs=(10_000, "runs"), workers=(2, "how many"))
    part.set_defaults(run=tiny)
    part = parts.add_parser("simulation", help="many workers, a scheduler and a disk")
    part.add_argument("table", type=Path, help="results.csv of a batch, to draw runs from")
    add_counts(part, jobs=(100_000, "runs"), workers=(1000, "how many"), seed=(0, "of the draws"))
    part.add_argument("--service", type=float, help="seconds of the scheduler a run [measured]")
    part.set_defaults(run=simulation)
    part = parts.add_parser("full", help="killed and gone on with: the same table")
    part.add_argument("--frames", type=int, help="at most, of each sequence [all]")
    add_counts(
        part,
        made_up_frames=(200, "of each of the ten made-up sequences"),
        seeds=(5, "runs of each"),
        kills=(1, "how often it is killed"),
        workers=(2, "how many"),
        seed=(0, "of the moments"),
    )
    _with_size(part, "320x240")
    part.set_defaults(run=full)
    return parser.parse_args()


def main() -> None:
    arguments = parse()
    arguments.run(arguments, console_of(arguments))


if __name__ == "__main__":
    main()
