# SPDX-License-Identifier: BSD-3-Clause
"""Results of each effort: error against time, over how often frames become keyframes.

Every sequence with ground truth, recorded and made up, with threads and in the deterministic mode,
several times from different first frames and with different seeds. Efforts take turns, so that they
see the same state of the machine.

    python -m benchmarks.accuracy.effort --starts 3
    python -m benchmarks.accuracy.effort --starts 1 --recorded-only --modes threads
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Table

from benchmarks.accuracy.final_adjustment import RECORDED
from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.runs import run_report
from benchmarks.harness.tables import new_table
from orbslam2py import Effort
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

MODES = {"threads": [], "deterministic": ["--deterministic"]}
SIZE = (320, 240)
STREET = (620, 188)
#: Walked, shaken and driven.
MADE_UP = [
    SyntheticOptions(world="corridor", sensor="rgbd", size=SIZE, noise=4, depth_noise=0.003),
    SyntheticOptions(world="corridor", sensor="mono", size=SIZE, noise=4),
    SyntheticOptions(world="figure-eight", sensor="stereo", size=SIZE, noise=4),
    SyntheticOptions(world="room", sensor="rgbd", size=SIZE, noise=4, motion="shakes"),
    SyntheticOptions(world="street-lap", sensor="stereo", size=STREET, noise=4, frames=400),
]


def measured(
    folder: Path, sensor: str, modes: list[str], n_starts: int
) -> dict[tuple[str, Effort], list[dict[str, Any]]]:
    """Reports of all runs of a sequence."""
    reports: dict[tuple[str, Effort], list[dict[str, Any]]] = {
        (mode, effort): [] for mode in modes for effort in Effort
    }
    for start in range(n_starts):
        for (mode, effort), told in reports.items():
            options = ["--start", str(start), "--seed", str(start), "--effort", str(effort)]
            told.append(run_report(folder, sensor, *MODES[mode], *options))
    return reports


def rows(
    name: str, sensor: str, folder: Path, modes: list[str], n_starts: int
) -> Iterator[tuple[str, ...]]:
    """A row for each mode and effort; speed also as a multiple of the normal one's."""
    reports = measured(folder, sensor, modes, n_starts)
    for (mode, effort), told in reports.items():

        def middle(key: str, among: list[dict[str, Any]] = told) -> float:
            return statistics.median(float(one.get(key) or "nan") for one in among)

        speed = middle("slam_frames_per_second")
        normal = middle("slam_frames_per_second", reports[mode, Effort.NORMAL])
        errors = [float(one.get("ate_rmse_m") or "nan") for one in told]
        counts = [one["keyframes"] for one in told]
        yield (
            name,
            sensor,
            mode,
            str(effort),
            f"{speed:.1f}",
            f"{speed / normal:.2f}",
            f"{statistics.median(errors):.4f} ({min(errors):.4f}..{max(errors):.4f})",
            f"{middle('rpe_translation_rmse_m'):.5f}",
            f"{min(counts)}..{max(counts)}",
            f"{min(one['tracked_fraction'] for one in told):.1%}",
        )


def sequences(*, made_up: bool) -> Iterator[tuple[str, str, Path]]:
    """Names, sensors and folders; made-up ones are there until the next is asked for."""
    for name, folder, sensor in RECORDED:
        yield name, sensor, sequence_folder(folder)
    for options in MADE_UP if made_up else ():
        with tempfile.TemporaryDirectory() as place:
            folder = SyntheticSequence(options).write(Path(place) / "sequence")
            yield f"{options.world}, {options.motion}", str(options.sensor), folder


def table_of(n_starts: int) -> Table:
    """The empty table."""
    return new_table(
        "Effort",
        ["sequence", "sensor", "mode", "effort"],
        [
            "frames/s",
            "times\nnormal",
            "RMSE [m],\nmedian (least..most)",
            "error over\none frame [m]",
            "keyframes",
            "tracked\n(least)",
        ],
        f"medians of {n_starts} runs",
    )


def main() -> None:
    """Run all and print a table."""
    parser = new_parser(__doc__)
    add_counts(parser, starts=(3, "first frames, each with another seed"))
    parser.add_argument("--recorded-only", action="store_true", help="no made-up sequences")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=list(MODES), help="[all]")
    parser.add_argument("--only", default="", metavar="TEXT", help="sequences with it in the name")
    add_width(parser)
    arguments = parser.parse_args()
    table = table_of(arguments.starts)
    for name, sensor, folder in sequences(made_up=not arguments.recorded_only):
        if arguments.only in name:
            for row in rows(name, sensor, folder, arguments.modes, arguments.starts):
                table.add_row(*row)
                print(*row, sep=" | ", flush=True)
    console_of(arguments).print(table)


if __name__ == "__main__":
    main()
