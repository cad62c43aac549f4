# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy of every sequence beside the original's.

Threaded runs with stereo or RGB-D differ from each other and are repeated; deterministic runs do
not, so they start at different frames instead. With a single camera the seed decides which two
views begin the map: every run has its own, and the median over them is judged.

    python -m benchmarks.accuracy.accuracy --runs 5 --starts 5
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from benchmarks.harness import reference
from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.reference import MonocularFigure, SequenceFigure
from benchmarks.harness.runs import run_report
from benchmarks.harness.tables import new_table, verdict


def _spread(values: Sequence[float], digits: int = 4) -> str:
    middle = statistics.median(values)
    return f"{middle:.{digits}f} ({min(values):.{digits}f}..{max(values):.{digits}f})"


def accuracy_rows(
    figure: SequenceFigure, folder: Path, n_runs: int, n_starts: int
) -> Iterator[Any]:
    """One row per mode."""
    modes = {
        f"threads, {n_runs} runs": [[] for _ in range(n_runs)],
        f"deterministic, starts 0..{n_starts - 1}": [
            ["--deterministic", "--start", str(start)] for start in range(n_starts)
        ],
    }
    for mode, options in modes.items():
        reports = [run_report(folder, figure.sensor, *words) for words in options]
        errors = [float(report["ate_rmse_m"]) for report in reports]
        keyframes = [int(report["keyframes"]) for report in reports]
        tracked = min(float(report["tracked_fraction"]) for report in reports)
        speed = statistics.median(float(r["slam_frames_per_second"]) for r in reports)
        yield (
            figure.name,
            mode,
            _spread(errors),
            f"{figure.ate} ({figure.ate_range[0]}..{figure.ate_range[1]})",
            f"{statistics.median(errors) / figure.ate:.2f}",
            f"{100 * tracked:.0f} %",
            f"{min(keyframes)}..{max(keyframes)}",
            str(figure.keyframes),
            f"{speed:.0f}",
        )


def monocular_rows(figure: MonocularFigure, folder: Path, n_runs: int) -> Iterator[Any]:
    """One row per mode."""
    for mode, options in {"threads": [], "deterministic": ["--deterministic"]}.items():
        reports = [
            run_report(folder, "mono", *options, "--seed", str(seed)) for seed in range(n_runs)
        ]
        keyframes_errors = [float(report["ate_keyframes_rmse_m"]) for report in reports]
        frames_errors = [float(report["ate_rmse_m"]) for report in reports]
        tracked = [int(report["tracked"]) for report in reports]
        keyframes = [int(report["keyframes"]) for report in reports]
        limit = reference.MONOCULAR_ERROR_RATIO
        met = (
            statistics.median(keyframes_errors) <= limit * figure.keyframes_ate
            and statistics.median(frames_errors) <= limit * figure.frames_ate
            and statistics.median(tracked) >= reference.MONOCULAR_TRACKED_RATIO * figure.tracked
        )
        yield (
            figure.name,
            f"{mode}, seeds 0..{n_runs - 1}",
            _spread(keyframes_errors),
            str(figure.keyframes_ate),
            _spread(frames_errors),
            str(figure.frames_ate),
            _spread(tracked, 0),
            f"{figure.tracked} of {figure.frames}",
            f"{min(keyframes)}..{max(keyframes)}",
            str(figure.keyframes),
            verdict(met),
        )


def _depth_table(n_runs: int, n_starts: int) -> Table:
    table = new_table(
        "Accuracy: RMSE in metres of all frames after rigid alignment, median (least..most)",
        ["sequence", "mode"],
        [
            "ours",
            "reference",
            "ours /\nreference",
            "tracked\n(least)",
            "keyframes",
            "keyframes\nreference",
            "frames/s\nhere",
        ],
    )
    for figure in [*reference.SEQUENCES, reference.STILL]:
        folder = sequence_folder(figure.folder)
        # 8 frames only: starting later leaves too little.
        own_starts = 1 if figure is reference.STILL else n_starts
        for row in accuracy_rows(figure, folder, n_runs, own_starts):
            table.add_row(*row)
    return table


def _monocular_table(n_runs: int) -> Table:
    table = new_table(
        "A single camera: RMSE in metres after similarity alignment, median (least..most)",
        ["sequence", "mode"],
        [
            "ATE of\nkeyframes",
            "refer-\nence",
            "ATE of\nall frames",
            "refer-\nence",
            "tracked",
            "refer-\nence",
            "key-\nframes",
            "refer-\nence",
            "met",
        ],
    )
    for figure in reference.MONOCULAR:
        for row in monocular_rows(figure, sequence_folder(figure.folder), n_runs):
            table.add_row(*row)
    return table


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(
        parser,
        runs=(5, "threaded runs; seeds of one camera"),
        starts=(5, "first frames of deterministic runs"),
    )
    parser.add_argument("--only", choices=("mono", "depth"), help="one of the two tables")
    add_width(parser)
    arguments = parser.parse_args()
    console = console_of(arguments)
    if arguments.only != "mono":
        console.print(_depth_table(arguments.runs, arguments.starts))
    if arguments.only != "depth":
        console.print(_monocular_table(arguments.runs))


if __name__ == "__main__":
    main()
