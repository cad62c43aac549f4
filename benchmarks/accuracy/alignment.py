# SPDX-License-Identifier: BSD-3-Clause
"""What alignment gives while the map grows (docs/method/alignment.md), one switch after the other.

Every sequence from several first images, deterministic: nothing but the switches differs. The
figures are geometric means of the ATE over the first images, divided by that without alignment.

    python -m benchmarks.accuracy.alignment --starts 5
    python -m benchmarks.accuracy.alignment --only "KITTI 06" --switches all
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.runs import run_report
from benchmarks.harness.tables import new_table
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

OFF = tuple(f"alignment.{sensor}=false" for sensor in ("rgbd", "stereo", "monocular"))
ON = tuple(f"alignment.{sensor}=true" for sensor in ("rgbd", "stereo", "monocular"))
NO_KEYFRAMES = ("alignment.new_keyframes=false",)
NO_FRAMES = ("alignment.tracked_inliers=0",)
RIGHT = ("alignment.right_image=true",)
#: Changes of the configuration by the name of the column.
SWITCHES: dict[str, tuple[str, ...]] = {
    "default": (),
    "right image": (*ON, *RIGHT, *NO_KEYFRAMES, *NO_FRAMES),
    "keyframes": (*ON, *NO_FRAMES),
    "frames": (*ON, *NO_KEYFRAMES),
    "both": ON,
    "all": (*ON, *RIGHT),
    "followed": (*ON, "alignment.follow=true"),
}
RECORDED = [
    ("TUM desk", "tum_fr1_desk_rgb110", "mono"),
    ("redkitchen", "7scenes_redkitchen_head250", "rgbd"),
    ("redkitchen", "7scenes_redkitchen_head250", "mono"),
    ("EuRoC MH_01", "euroc_MH_01_first170", "stereo"),
    ("EuRoC MH_01", "euroc_MH_01_first170", "mono"),
    ("KITTI 06", "kitti_06_head51_stereo", "stereo"),
    ("KITTI 06", "kitti_06_head51_stereo", "mono"),
    ("KITTI 03", "kitti_03_left_head120", "mono"),
]
MADE_UP = [
    (f"made-up {world}", SyntheticOptions(world=world, sensor=sensor, frames=frames, noise=2))
    for world, frames in (("room", 100), ("street", 60))
    for sensor in ("mono", "stereo", "rgbd")
    if (world, sensor) != ("street", "rgbd")
]


@dataclass(frozen=True)
class Case:
    """A sequence with a sensor."""

    name: str
    sensor: str
    recorded: str | None = None
    options: SyntheticOptions | None = None

    @contextmanager
    def folder(self) -> Iterator[Path]:
        """Where it is; what is made up goes again."""
        if self.recorded is not None:
            yield sequence_folder(self.recorded)
            return
        assert self.options is not None
        with tempfile.TemporaryDirectory() as place:
            yield SyntheticSequence(self.options).write(Path(place) / "sequence")


def cases(only: str) -> list[Case]:
    """All whose name contains these words."""
    made_up = [Case(name, str(o.sensor), options=o) for name, o in MADE_UP]
    recorded = [Case(name, sensor, recorded=folder) for name, folder, sensor in RECORDED]
    return [case for case in (*made_up, *recorded) if only.lower() in case.name.lower()]


def mean_error(folder: Path, sensor: str, changes: tuple[str, ...], n_starts: int) -> float:
    """Geometric mean of the ATE over the first images [m]; NaN if a run has none."""
    sets = [word for change in changes for word in ("--set", change)]
    total = 0.0
    for start in range(n_starts):
        report = run_report(folder, sensor, "--deterministic", "--start", str(start), *sets)
        error = report.get("ate_rmse_m")
        if not error:
            return math.nan
        total += math.log(error)
    return math.exp(total / n_starts)


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(parser, starts=(5, "first images"))
    parser.add_argument("--only", default="", help="sequences whose name contains this [all]")
    parser.add_argument(
        "--switches", nargs="+", choices=SWITCHES, default=list(SWITCHES), help="columns [all]"
    )
    add_width(parser)
    arguments = parser.parse_args()
    table = new_table(
        "ATE without alignment in metres, and with it, divided by that",
        ["sequence", "sensor"],
        ["without", *arguments.switches],
    )
    logarithms: dict[str, list[float]] = {name: [] for name in arguments.switches}
    for case in cases(arguments.only):
        with case.folder() as folder:
            without = mean_error(folder, case.sensor, OFF, arguments.starts)
            ratios = []
            for name in arguments.switches:
                error = mean_error(folder, case.sensor, SWITCHES[name], arguments.starts)
                ratios.append(error / without)
                if math.isfinite(ratios[-1]):
                    logarithms[name].append(math.log(ratios[-1]))
        table.add_row(
            case.name, case.sensor, f"{without:.5f}", *(f"{ratio:.3f}" for ratio in ratios)
        )
    means = [
        f"{math.exp(sum(values) / len(values)):.3f}" if values else "-"
        for values in logarithms.values()
    ]
    table.add_row("geometric mean", "", "", *means)
    console_of(arguments).print(table)


if __name__ == "__main__":
    main()
