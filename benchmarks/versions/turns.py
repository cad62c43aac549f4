# SPDX-License-Identifier: BSD-3-Clause
"""Recorded sequences with this version and another one, in turns: speed and error.

The other version is a checkout in which it is installed (``git worktree add ../before COMMIT``, and
there ``make install``). Each turn plays every sequence with both, one after the other, so that both
see the same machine. With threads each turn has another seed; deterministic runs differ by nothing
but their first image, so there each begins one image later. Speed wants a machine on which nothing
else runs. Where a recording's own calibration is in question, both take another one with
``--settings``, or right images moved by a part of a pixel with ``--right-moved``.

    python -m benchmarks.versions.turns ../before
    python -m benchmarks.versions.turns ../before --turns 10 --deterministic --only stereo
    python -m benchmarks.versions.turns ../before --options "--effort thorough"
    python -m benchmarks.versions.turns ../before --only redkitchen --settings other.yaml
    python -m benchmarks.versions.turns ../before --only stereo --right-moved 0.085
"""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import needed_shared_folder
from benchmarks.harness.moved_right import MOST_MOVED, with_moved_right_images
from benchmarks.harness.runs import median_of, run_report
from benchmarks.harness.tables import new_table

Report = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """A recorded sequence and how it is played."""

    name: str
    folder: str
    sensor: str


CASES = (
    Case("redkitchen, RGB-D", "7scenes_redkitchen_head250", "rgbd"),
    Case("KITTI 06, stereo", "kitti_06_head51_stereo", "stereo"),
    Case("KITTI 03, mono", "kitti_03_left_head120", "mono"),
    Case("KITTI 06, mono", "kitti_06_head51_stereo", "mono"),
    Case("redkitchen, mono", "7scenes_redkitchen_head250", "mono"),
)
_COLUMNS = (
    "frames/s before",
    "now",
    "ratio",
    "system alone, ratio",
    "track ms before",
    "now",
    "mapping ms before",
    "now",
    "ATE m before",
    "now",
    "ratio",
)


def options_of_turn(turn: int, *, deterministic: bool, settings: Path | None = None) -> list[str]:
    """What both versions' runs have in common; the fields that identify a turn come first."""
    own = ["--deterministic", "--start", str(turn)] if deterministic else ["--seed", str(turn)]
    return own if settings is None else [*own, "--settings", str(settings.resolve())]


def python_of(checkout: Path) -> str:
    """The interpreter of a checkout; ends the program where nothing is installed."""
    python = checkout / ".venv" / "bin" / "python"
    if not python.is_file():
        sys.exit(f"{checkout} has no {python.relative_to(checkout)}: run make install there")
    return str(python)


def row(before: list[Report], now: list[Report]) -> list[str]:
    """Medians of both, and ratios of the medians."""

    def both(form: str, *keys: str) -> list[str]:
        return [format(median_of(reports, *keys), form) for reports in (before, now)]

    def ratio(*keys: str) -> str:
        return f"{median_of(now, *keys) / median_of(before, *keys):.2f}"

    return [
        *both(".1f", "frames_per_second"),
        ratio("frames_per_second"),
        ratio("slam_frames_per_second"),
        *both(".2f", "milliseconds", "track", "median"),
        *both(".1f", "milliseconds", "mapping", "mean"),
        *both(".4f", "ate_rmse_m"),
        ratio("ate_rmse_m"),
    ]


def main() -> None:
    """Play, and print a table."""
    parser = new_parser(__doc__)
    parser.add_argument("before", type=Path, help="checkout of the other version, installed")
    parser.add_argument("--only", metavar="TEXT", default="", help="cases with this in their name")
    parser.add_argument("--deterministic", action="store_true", help="[with threads]")
    parser.add_argument("--options", default="", help="of this version's runs alone, one string")
    parser.add_argument(
        "--settings", type=Path, metavar="FILE", help="of both versions' runs [each recording's]"
    )
    parser.add_argument(
        "--right-moved",
        type=float,
        metavar="PIXELS",
        help="right images, for both versions, moved left by so much; stereo cases alone",
    )
    add_counts(parser, turns=(5, "turns"))
    add_width(parser, 170)
    arguments = parser.parse_args()
    folder = needed_shared_folder() / "sequences"
    python = python_of(arguments.before)
    moved = arguments.right_moved
    if moved is not None and not abs(moved) < MOST_MOVED:
        parser.error(f"--right-moved {moved}: less than {MOST_MOVED:g} pixels to either side")
    possible = [case for case in CASES if moved is None or case.sensor == "stereo"]
    cases = [case for case in possible if arguments.only in case.name]
    if not cases or arguments.turns < 1:
        names = "; ".join(case.name for case in possible)
        parser.error(f"nothing to play: --turns {arguments.turns}, and --only one of: {names}")
    if arguments.settings is not None and not arguments.settings.is_file():
        parser.error(f"--settings {arguments.settings}: there is no such file")
    with tempfile.TemporaryDirectory() as copies:
        if moved is not None:
            for case in cases:
                with_moved_right_images(folder / case.folder, moved, Path(copies) / case.folder)
            folder = Path(copies)
        print_turns(console_of(arguments).print, cases, folder, python, arguments)


def print_turns(
    tell: Callable[[object], None],
    cases: list[Case],
    folder: Path,
    python: str,
    arguments: argparse.Namespace,
) -> None:
    """Play all turns of each case, and print the table of them."""
    how = "deterministic, first images" if arguments.deterministic else "threads, seeds"
    title = f"In turns with {arguments.before}: {how} 0 to {arguments.turns - 1}, medians"
    table = new_table(title, ["sequence"], _COLUMNS)
    for case in cases:
        before: list[Report] = []
        now: list[Report] = []
        for turn in range(arguments.turns):
            options = options_of_turn(
                turn, deterministic=arguments.deterministic, settings=arguments.settings
            )
            place = folder / case.folder
            before.append(run_report(place, case.sensor, *options, python=python))
            more = shlex.split(arguments.options)
            now.append(run_report(place, case.sensor, *options, *more))
        table.add_row(case.name, *row(before, now))
    tell(table)


if __name__ == "__main__":
    main()
