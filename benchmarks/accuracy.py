# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy of every stereo and RGB-D sequence beside the original's.

Threaded runs differ from each other and are repeated; deterministic runs do not, so they start at
different frames instead.

    python benchmarks/accuracy.py --runs 5 --starts 5
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import reference
import runs
from reference import SequenceFigure
from rich.console import Console
from tables import new_table
from yardstick import shared_folder


def _spread(values: list[float], digits: int = 4) -> str:
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="threaded runs")
    parser.add_argument("--starts", type=int, default=5, help="first frames of deterministic runs")
    parser.add_argument("--width", type=int, default=150, help="columns of the output")
    arguments = parser.parse_args()
    shared = shared_folder()
    if shared is None:
        sys.exit("the sequences are not there: set ORBSLAM2PY_SHARED to their folder")
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
        n_starts = 1 if figure is reference.STILL else arguments.starts
        for row in accuracy_rows(figure, folder, arguments.runs, n_starts):
            table.add_row(*row)
    Console(width=arguments.width).print(table)


if __name__ == "__main__":
    main()
