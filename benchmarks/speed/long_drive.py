# SPDX-License-Identifier: BSD-3-Clause
"""Time per frame and memory of the map, as a drive along a street gets longer.

One run in the deterministic mode, where mapping and loop detection are part of a frame: what grows
is seen in the processor time of each. Images are rendered on the way, outside of what is measured.
Memory is read after ``malloc_trim``, so that freed blocks do not count. The curve goes to
build/bench/long_drive.png.

    python -m benchmarks.speed.long_drive
    python -m benchmarks.speed.long_drive --metres 600 --sensors mono --autosave
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from rich.table import Table

from benchmarks.harness.arguments import add_counts, add_sensors, add_width, console_of, new_parser
from benchmarks.harness.process_memory import resident_mb
from benchmarks.harness.tables import in_words, new_table
from orbslam2py import System
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

SIZE = (620, 188)
#: Metres over which a figure is taken; after `SETTLED` it may not grow by more than `FLAT`.
STRETCH, SETTLED, FLAT = 100.0, 300.0, 1.2
SPEED, FPS = 10.0, 10.0


@dataclass(frozen=True)
class Stretch:
    """What some metres of the way cost."""

    metres: float
    """Since the start, at its end."""
    milliseconds: float
    """Processor time of a frame, mapping included: mean."""
    snapshot: float
    """Milliseconds of a look at the whole map, at its end."""
    trajectory: float
    """The same for the path of all frames."""
    keyframes: int
    points: int
    resident_mb: float
    lost: int


def drive(sensor: str, metres: float, seed: int, *, autosave: bool) -> list[Stretch]:
    """Track a drive and look at every stretch of it."""
    options = SyntheticOptions(
        world="street",
        sensor=sensor,
        length=metres + 50,
        frames=round(metres / SPEED * FPS),
        speed=SPEED,
        fps=FPS,
        size=SIZE,
        noise=2.0,
        seed=seed,
    )
    sequence = SyntheticSequence(options)
    done: list[Stretch] = []
    spent: list[float] = []
    lost = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        System(sequence.settings, sensor, deterministic=True) as slam,
    ):
        if autosave:
            slam.autosave(Path(folder) / "drive.orbmap", every=5.0)
        for number in range(len(sequence)):
            images = sequence.load(number)
            begin = time.process_time()
            record = slam.track(images, float(sequence.nanoseconds[number]) / 1e9)
            spent.append(time.process_time() - begin)
            lost += record.T_cw is None
            driven = (number + 1) * SPEED / FPS
            if driven < (len(done) + 1) * STRETCH:
                continue
            done.append(
                Stretch(
                    driven,
                    1e3 * statistics.fmean(spent),
                    milliseconds_of(slam.map_snapshot),
                    milliseconds_of(slam.trajectory),
                    slam.n_keyframes,
                    slam.n_map_points,
                    resident_mb(trimmed=True),
                    lost,
                )
            )
            spent.clear()
            lost = 0
    return done


def milliseconds_of(work: Callable[[], object]) -> float:
    """Time of one call on the clock."""
    begin = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begin)


def growth(done: list[Stretch]) -> float:
    """Of a frame's cost: last quarter of what comes after the start, by its first quarter."""
    settled = [stretch.milliseconds for stretch in done if stretch.metres > SETTLED]
    quarter = max(1, len(settled) // 4)
    return statistics.fmean(settled[-quarter:]) / statistics.fmean(settled[:quarter])


def table_of(sensor: str, done: list[Stretch]) -> Table:
    """A row a stretch."""
    first, last = done[0], done[-1]
    kilobytes = 1e3 * (last.resident_mb - first.resident_mb) / (last.keyframes - first.keyframes)
    told = ""
    if last.metres > 2 * SETTLED:
        told = (
            f"; a frame costs {growth(done):.2f} times what it does after {SETTLED:.0f} m, "
            f"target {FLAT}: {in_words(growth(done) <= FLAT)}"
        )
    table = new_table(
        f"A drive, {sensor}, {SIZE[0]}x{SIZE[1]}, deterministic",
        [],
        ["metres", "ms a frame", "map copy, ms", "path, ms", "keyframes", "points", "MB", "lost"],
        f"{kilobytes:.0f} kB a keyframe with its points{told}",
    )
    for one in done:
        times = (f"{ms:.1f}" for ms in (one.milliseconds, one.snapshot, one.trajectory))
        counts = (str(n) for n in (one.keyframes, one.points))
        table.add_row(f"{one.metres:.0f}", *times, *counts, f"{one.resident_mb:.0f}", str(one.lost))
    return table


def draw(drives: dict[str, list[Stretch]], file: Path) -> None:
    """Curves of cost and of memory."""
    figure = Figure(figsize=(9, 3.5), layout="constrained")
    cost, memory = figure.subplots(1, 2)
    for sensor, done in drives.items():
        metres = [one.metres for one in done]
        cost.plot(metres, [one.milliseconds for one in done], label=sensor)
        memory.plot(metres, [one.resident_mb for one in done], label=sensor)
    cost.set(xlabel="driven [m]", ylabel="processor time of a frame [ms]")
    memory.set(xlabel="driven [m]", ylabel="resident memory [MB]")
    for axes in (cost, memory):
        axes.set_ylim(bottom=0)
        axes.grid(visible=True, alpha=0.3)
        axes.legend()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=130)


def main() -> None:
    """Drive, print tables, draw."""
    parser = new_parser(__doc__)
    add_sensors(parser)
    add_counts(parser, metres=(2000, "length of the drive"), seed=(0, "of the street"))
    parser.add_argument("--autosave", action="store_true", help="keep a map file up to date")
    parser.add_argument("--picture", type=Path, default=Path("build/bench/long_drive.png"))
    add_width(parser)
    arguments = parser.parse_args()
    if arguments.metres < 2 * STRETCH:
        parser.error(f"a drive takes at least {2 * STRETCH:.0f} metres, to see what grows")
    console = console_of(arguments)
    drives = {}
    for sensor in arguments.sensors:
        done = drive(sensor, arguments.metres, arguments.seed, autosave=arguments.autosave)
        drives[sensor] = done
        console.print(table_of(sensor, done))
    draw(drives, arguments.picture)


if __name__ == "__main__":
    main()
