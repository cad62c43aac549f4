# SPDX-License-Identifier: BSD-3-Clause
"""Cost of a loop closure by the size of the map, and effect of a full adjustment on tracking.

Every step runs in made-up maps of 250 to 10 000 keyframes; the limits of the steps are for
1000, those of the whole correction and of memory for all sizes. The curve goes to
build/bench/loop_cost.png.

    python -m benchmarks.loops.cost
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.harness import reference
from benchmarks.harness.arguments import add_build, add_width, console_of, new_parser
from benchmarks.harness.folders import how_to_build
from benchmarks.harness.machine import print_machine
from benchmarks.harness.runs import Record, benchmark_records, run_module
from benchmarks.harness.steps import Row, steps_table
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import Times, Yardstick
from benchmarks.loops.tracking import Measured, tracking_table

SIZES = (250, 500, 1000, 2000, 4000, 10000)
LIMIT_SIZE = 1000
"""Keyframes at which the limits of the steps hold."""
LIMIT_CORRECTED_S = 5.0
"""From the end of the verification until the map is corrected, at any size."""
LIMIT_MEMORY_GROWTH = 1.1
"""Kilobytes a keyframe of a full adjustment: those of the largest map over those of 1000."""


@dataclass
class Step:
    """A part of closing a loop."""

    key: str
    """In `reference.LOOPS`."""
    note: str
    by_size: dict[int, Times] = field(default_factory=dict)
    row: Row | None = None
    """At the size of the limits."""
    memory_kb: dict[int, float] = field(default_factory=dict)
    """Most that was held at once, by size; only of the full adjustment."""

    @property
    def name(self) -> str:
        return reference.LOOPS[self.key].name

    def add(self, size: int, median: float, least: float) -> None:
        """Note one size [ms]."""
        self.by_size[size] = Times(median, least)

    @property
    def growth(self) -> list[float]:
        """Exponent of the cost between each size and the next: 1 is linear."""
        return [
            math.log(self.by_size[b].least / self.by_size[a].least) / math.log(b / a)
            for a, b in itertools.pairwise(SIZES)
        ]


# ---- the steps -----------------------------------------------------------------------------------
def _measured(step: Step, found: dict[str, Record], name: str) -> Step:
    """Fill a step with the records of a benchmark; `name` has a place for the size."""
    for n in SIZES:
        record = found[name.format(n)]
        step.add(n, record["median_ms"], record["min_ms"])
    return step


def _detection(build: Path) -> list[Step]:
    found = benchmark_records(build, "loop_detection_bench", "BM_DetectLoop")
    step = Step("detection", "at a place seen before; in a new one about half")
    return [_measured(step, found, "BM_DetectLoop/keyframes:{}/known:1")]


def _verification(build: Path) -> list[Step]:
    """The slowest of several shares of wrong matches, and the choice among eight loops."""
    pattern = "BM_VerifyLoopCandidate|BM_ChooseLoopOfEight"
    found = benchmark_records(build, "loops_bench", pattern, "--benchmark_min_time=0.2")
    verified = [r for name, r in found.items() if name.startswith("BM_VerifyLoopCandidate")]
    slowest = max(verified, key=lambda record: record["min_ms"])
    step = Step(
        "verification",
        "one candidate, 1000 features, and the choice among eight loops: only the choice grows",
    )
    for n in SIZES:
        choice = found[f"BM_ChooseLoopOfEight/keyframes:{n}"]
        step.add(
            n, slowest["median_ms"] + choice["median_ms"], slowest["min_ms"] + choice["min_ms"]
        )
    return [step]


def _correction(build: Path) -> list[Step]:
    found = benchmark_records(build, "loop_correction_bench", "BM_CorrectLoop/.*monocular:0")
    whole = Step("correction", "processor time; plan, prepare under the read lock, write")
    lock = Step("correction_lock", "processor time; readers of the map are locked out")
    for n in SIZES:
        record = found[f"BM_CorrectLoop/keyframes:{n}/monocular:0"]
        parts = ("plan", "prepare", "write")
        whole.add(
            n,
            sum(record[f"{part}_median_ms"] for part in parts),
            sum(record[f"{part}_min_ms"] for part in parts),
        )
        lock.add(n, record["write_median_ms"], record["write_min_ms"])
    return [whole, lock]


def _essential_graph(build: Path) -> list[Step]:
    pattern = "BM_OptimizePoseGraph/.*fix_scale:0/eigen:0"
    found = benchmark_records(build, "pose_graph_bench", pattern, "--benchmark_min_time=1.5")
    step = Step("essential_graph", "with scales (one camera); four and a half edges a keyframe")
    return [_measured(step, found, "BM_OptimizePoseGraph/keyframes:{}/fix_scale:0/eigen:0")]


def _full_adjustment(build: Path) -> list[Step]:
    found = benchmark_records(build, "full_bundle_bench", "BM_FullBundle/stereo/")
    record = found[f"BM_FullBundle/stereo/{LIMIT_SIZE}"]
    step = Step(
        "full_adjustment",
        f"one thread; {record['points']:.0f} points, {record['observations']:.0f} observations, "
        f"{record['steps']:.0f} steps; in brackets processor time",
    )
    for n in SIZES:
        record = found[f"BM_FullBundle/stereo/{n}"]
        around = record["gather_ms"] + record["commit_ms"]
        step.add(n, around + 1e3 * record["solve_wall_s"], around + 1e3 * record["solve_s"])
        step.memory_kb[n] = record["memory_kb"]
    return [step]


_SOURCES = (_detection, _verification, _correction, _essential_graph, _full_adjustment)
_PROGRAMS = (
    "loop_detection_bench",
    "loops_bench",
    "loop_correction_bench",
    "pose_graph_bench",
    "full_bundle_bench",
)


def measure(yardstick: Yardstick, build: Path) -> list[Step]:
    """All steps, each with the yardstick around its program."""
    steps: list[Step] = []
    for source in _SOURCES:
        found: list[Step] = []

        def work(source=source, found=found) -> float:  # type: ignore[no-untyped-def]
            found += source(build)
            return found[0].by_size[LIMIT_SIZE].median

        around = yardstick.around([work])
        for step in found:
            measured = replace(around, ours=step.by_size[LIMIT_SIZE])
            step.row = Row(step.name, reference.LOOPS[step.key], measured, step.note)
        steps += found
    return steps


# ---- what is shown -------------------------------------------------------------------------------
def sizes_table(steps: list[Step]) -> object:
    """Milliseconds here by keyframes, and how they grow."""
    table = new_table(
        "The same by size of the map: ms here, and the exponent of the growth (1: linear)",
        ["step"],
        [f"{n}\nkeyframes" for n in SIZES] + [f"{a}\nto {b}" for a, b in itertools.pairwise(SIZES)],
        "Exponents of the least times (full adjustment: of processor time).",
    )
    for step in steps:
        cells = [f"{step.by_size[n].median:.3g}" for n in SIZES]
        table.add_row(step.name, *cells, *(f"{exponent:.2f}" for exponent in step.growth))
    return table


def large_maps_table(steps: list[Step]) -> object:
    """Seconds of the whole correction, and memory of the full adjustment after it."""
    by_key = {step.key: step for step in steps}
    memory = by_key["full_adjustment"].memory_kb
    seconds = {
        n: 1e-3 * sum(by_key[key].by_size[n].median for key in ("correction", "essential_graph"))
        for n in SIZES
    }
    growth = memory[SIZES[-1]] / SIZES[-1] / (memory[LIMIT_SIZE] / LIMIT_SIZE)
    table = new_table(
        "A loop corrected, and the memory of the full adjustment after it",
        ["what"],
        [f"{n}\nkeyframes" for n in SIZES] + ["limit", "kept"],
        "Corrected: correction, fusion and essential graph. Memory: most that was held at once, "
        f"beyond the map itself; largest map over that of {LIMIT_SIZE}: {growth:.2f} times.",
    )
    corrected = [f"{seconds[n]:.2g}" for n in SIZES]
    kept = verdict(max(seconds.values()) <= LIMIT_CORRECTED_S)
    table.add_row("corrected [s]", *corrected, f"{LIMIT_CORRECTED_S:g}", kept)
    held = [f"{memory[n] / n:.0f}" for n in SIZES]
    kept = verdict(growth <= LIMIT_MEMORY_GROWTH)
    table.add_row("memory [kB a keyframe]", *held, f"{LIMIT_MEMORY_GROWTH:g} times", kept)
    return table


def draw(steps: list[Step], path: Path) -> None:
    """Cost against size of the map, both logarithmic, into a PNG."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    for step in steps:
        times = [step.by_size[n].least for n in SIZES]
        (line,) = axes.plot(SIZES, times, "o-", label=step.name)
        limit = reference.LOOPS[step.key].limit
        if limit is not None:
            axes.plot([LIMIT_SIZE], [limit], "v", color=line.get_color(), fillstyle="none")
    low = 0.6 * min(step.by_size[SIZES[0]].least for step in steps)
    axes.plot(SIZES, [low * n / SIZES[0] for n in SIZES], ":", color="grey", label="linear")
    axes.plot([], [], "v", color="grey", fillstyle="none", label="limits at 1000")
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_xticks(SIZES, [str(n) for n in SIZES])
    axes.set_xlabel("keyframes in the map")
    axes.set_ylabel("milliseconds")
    axes.set_title("Closing a loop, by size of the map")
    axes.grid(visible=True, which="both", alpha=0.2)
    axes.legend(bbox_to_anchor=(1.01, 1), loc="upper left", frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def loop_tables(yardstick: Yardstick, build: Path, pictures: Path) -> Iterator[object]:
    """Steps of closing a loop, by size of the map; draws the curve."""
    missing = how_to_build(build, *_PROGRAMS)
    if missing is not None:
        yield f"[yellow]Loops: left out, {missing}"
        return
    steps = measure(yardstick, build)
    rows = [step.row for step in steps if step.row is not None]
    yield steps_table(f"Closing a loop in a map of {LIMIT_SIZE} keyframes", rows)
    yield sizes_table(steps)
    yield large_maps_table(steps)
    picture = pictures / "loop_cost.png"
    draw(steps, picture)
    yield f"Curve: {picture}"
    yield tracking_table(Measured(**run_module("benchmarks.loops.tracking", "--json")))


# ---- command line --------------------------------------------------------------------------------
def main() -> None:
    parser = new_parser(__doc__)
    add_build(parser)
    add_width(parser)
    arguments = parser.parse_args()
    console, yardstick = console_of(arguments), Yardstick()
    print_machine(console, yardstick)
    for table in loop_tables(yardstick, arguments.build, arguments.pictures):
        console.print(table)


if __name__ == "__main__":
    main()
