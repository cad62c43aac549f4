# SPDX-License-Identifier: BSD-3-Clause
"""Whether refining the finished map (run --final-adjustment) makes paths better.

Every sequence with ground truth, recorded and made up, several times from different first frames
and with different seeds, deterministic: with and without, a run differs in nothing but its end. The
adjustment is on by default for recorded data only if it makes no sequence worse by more than 2 %
and helps the median.

    python -m benchmarks.accuracy.final_adjustment --starts 5
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.runs import run_report
from benchmarks.harness.tables import in_words, new_table, verdict
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

#: The most that the error of a sequence may grow.
WORST_RATIO = 1.02

RECORDED = [
    ("redkitchen", "7scenes_redkitchen_head250", "rgbd"),
    ("redkitchen", "7scenes_redkitchen_head250", "mono"),
    ("KITTI 06", "kitti_06_head51_stereo", "stereo"),
    ("KITTI 06", "kitti_06_head51_stereo", "mono"),
    ("KITTI 03", "kitti_03_left_head120", "mono"),
    ("drone", "drone_semicircle", "mono"),
]
MADE_UP = [
    SyntheticOptions(world=world, sensor=sensor, laps=laps, noise=4, depth_noise=depth_noise)
    for world, sensor, laps, depth_noise in (
        ("corridor", "stereo", 1.2, 0.0),
        ("corridor", "rgbd", 1.2, 0.003),
        ("corridor", "mono", 1.2, 0.0),
        ("figure-eight", "stereo", 1.1, 0.0),
    )
]


@dataclass(frozen=True)
class Comparison:
    """A sequence with and without."""

    name: str
    sensor: str
    errors: list[tuple[float, float]]
    """RMSE [m] without and with, per run."""
    costs: list[float]
    """Of the adjustment, after over before, per run."""
    seconds: list[float]

    @property
    def ratio(self) -> float:
        """Median over the runs of the error with over the one without."""
        return statistics.median(after / before for before, after in self.errors)

    def row(self) -> tuple[str, ...]:
        """For the table."""
        before, after = zip(*self.errors, strict=True)
        ratios = [b / a for a, b in self.errors]
        return (
            self.name,
            self.sensor,
            str(len(self.errors)),
            f"{statistics.median(before):.4f}",
            f"{statistics.median(after):.4f}",
            f"{self.ratio:.3f} ({min(ratios):.3f}..{max(ratios):.3f})",
            f"{statistics.median(self.costs):.3f}",
            f"{statistics.median(self.seconds):.2f}",
            verdict(self.ratio <= WORST_RATIO),
        )


def compare(name: str, folder: Path, sensor: str, n_starts: int) -> Comparison | None:
    """Run a sequence from several starts, each with and without; None without an error to tell."""
    done = Comparison(name, sensor, [], [], [])
    for start in range(n_starts):
        options = ["--deterministic", "--start", str(start), "--seed", str(start)]
        plain, adjusted = (
            run_report(folder, sensor, *options, *more) for more in ([], ["--final-adjustment"])
        )
        record: dict[str, Any] | None = adjusted["final_adjustment"]
        before, after = plain.get("ate_rmse_m"), adjusted.get("ate_rmse_m")
        if record is None or before is None or after is None:
            continue
        done.errors.append((before, after))
        done.costs.append(record["final_cost"] / record["initial_cost"])
        done.seconds.append(sum(record["milliseconds"].values()) / 1000)
    return done if done.errors else None


def comparisons(n_starts: int, *, made_up: bool) -> Iterator[Comparison | None]:
    """All sequences."""
    for name, folder, sensor in RECORDED:
        yield compare(name, sequence_folder(folder), sensor, n_starts)
    if not made_up:
        return
    for options in MADE_UP:
        with tempfile.TemporaryDirectory() as place:
            folder = SyntheticSequence(options).write(Path(place) / "sequence")
            yield compare(str(options.world), folder, str(options.sensor), n_starts)


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(parser, starts=(5, "first frames, each with another seed"))
    parser.add_argument("--recorded-only", action="store_true", help="no made-up sequences")
    add_width(parser)
    arguments = parser.parse_args()
    table = new_table(
        "Full bundle adjustment of the finished map: RMSE in metres of all frames, medians",
        ["sequence", "sensor"],
        [
            "runs",
            "without",
            "with",
            "ratio (least..most)",
            "cost after /\nbefore",
            "seconds",
            f"at most\n{WORST_RATIO}",
        ],
    )
    found = comparisons(arguments.starts, made_up=not arguments.recorded_only)
    done = [comparison for comparison in found if comparison is not None]
    for comparison in done:
        table.add_row(*comparison.row())
    console = console_of(arguments)
    console.print(table)
    ratios = [comparison.ratio for comparison in done]
    middle = statistics.median(ratios)
    met = max(ratios) <= WORST_RATIO and middle < 1
    console.print(
        f"Median ratio {middle:.3f}, worst {max(ratios):.3f}: the condition for being on by "
        f"default is {in_words(met)}."
    )


if __name__ == "__main__":
    main()
