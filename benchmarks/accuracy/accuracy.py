# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy of every sequence beside the original's.

Threaded runs with stereo or RGB-D differ from each other and are repeated; deterministic runs do
not, so they start at different frames instead. With a single camera the seed decides which two
views begin the map: every run has its own, and the median over them is judged.

    python -m benchmarks.accuracy.accuracy --runs 5 --starts 5
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.harness import reference, runs
from benchmarks.harness.reference import MonocularFigure, SequenceFigure
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import shared_folder


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
        reports = [runs.run(folder, figure.sensor, *words) for words in options]
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
            runs.run(folder, "mono", *options, "--seed", str(seed)) for seed in range(n_runs)
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


def _depth_table(shared: Path, n_runs: int, n_starts: int) -> Table:
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
        folder = shared / "sequences" / figure.folder
        # 8 frames only: starting later leaves too little.
        own_starts = 1 if figure is reference.STILL else n_starts
        for row in accuracy_rows(figure, folder, n_runs, own_starts):
            table.add_row(*row)
    return table


def _monocular_table(shared: Path, n_runs: int) -> Table:
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
        for row in monocular_rows(figure, shared / "sequences" / figure.folder, n_runs):
            table.add_row(*row)
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="threaded runs; seeds of one camera")
    parser.add_argument("--starts", type=int, default=5, help="first frames of deterministic runs")
    parser.add_argument("--only", choices=("mono", "depth"), help="one of the two tables")
    parser.add_argument("--width", type=int, default=150, help="columns of the output")
    arguments = parser.parse_args()
    shared = shared_folder()
    if shared is None:
        sys.exit("the sequences are not there: set ORBSLAM2PY_SHARED to their folder")
    console = Console(width=arguments.width)
    if arguments.only != "mono":
        console.print(_depth_table(shared, arguments.runs, arguments.starts))
    if arguments.only != "depth":
        console.print(_monocular_table(shared, arguments.runs))


if __name__ == "__main__":
    main()
