# SPDX-License-Identifier: BSD-3-Clause
"""What closing a loop costs, by size of the map: programs of this folder, a table and a curve.

Every step runs in made-up maps of 250 to 4000 keyframes; the limits are for 1000.
"""

from __future__ import annotations

import itertools
import json
import math
import statistics
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.harness import reference
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import Times, Yardstick
from benchmarks.speed.single_steps import Row

SIZES = (250, 500, 1000, 2000, 4000)
LIMIT_SIZE = 1000
"""Keyframes at which the limits hold."""

Record = dict[str, float]
"""Counters of one benchmark."""


@dataclass
class Step:
    """A part of closing a loop."""

    key: str
    """In `reference.LOOPS`."""
    note: str
    by_size: dict[int, Times] = field(default_factory=dict)
    unit: Row | None = None

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


class Program:
    """A Google Benchmark program."""

    def __init__(self, build: Path, name: str, *options: str) -> None:
        self.path = build / "benchmarks" / "cpp" / name
        self._options = options

    def records(self, pattern: str) -> dict[str, Record]:
        """Counters by name without the numbers of iterations.

        Raises
        ------
        RuntimeError
            With the program's words, if it fails.
        """
        command = [str(self.path), "--benchmark_format=json", f"--benchmark_filter={pattern}"]
        done = subprocess.run(
            [*command, *self._options], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
        rows = json.loads(done.stdout)["benchmarks"]
        failed = [row for row in rows if row.get("error_occurred")]
        if failed or not rows:
            raise RuntimeError(f"{' '.join(command)}: {failed or 'nothing was measured'}")
        return {row["name"].split("/iterations:")[0].split("/manual")[0]: row for row in rows}


# ---- the steps -----------------------------------------------------------------------------------
def _detection(build: Path) -> list[Step]:
    found = Program(build, "loop_detection_bench").records("BM_DetectLoop")
    step = Step("detection", "at a place seen before; in a new one about half")
    for n in SIZES:
        record = found[f"BM_DetectLoop/keyframes:{n}/known:1"]
        step.add(n, record["median_ms"], record["min_ms"])
    return [step]


def _verification(build: Path) -> list[Step]:
    """The slowest of several shares of wrong matches, and the choice among eight loops."""
    program = Program(build, "loops_bench", "--benchmark_min_time=0.2")
    found = program.records("BM_VerifyLoopCandidate|BM_ChooseLoopOfEight")
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
    found = Program(build, "loop_correction_bench").records("BM_CorrectLoop/.*monocular:0")
    whole = Step("correction", "processor time; plan, prepare under the read lock, write")
    lock = Step("correction_lock", "processor time; nobody reads the map meanwhile")
    for n in SIZES:
        record = found[f"BM_CorrectLoop/keyframes:{n}/monocular:0"]
        parts = ("plan", "prepare", "write")
        whole.add(
            n,
            sum(record[f"{part}_ms"] for part in parts),
            sum(record[f"{part}_least_ms"] for part in parts),
        )
        lock.add(n, record["write_ms"], record["write_least_ms"])
    return [whole, lock]


def _essential_graph(build: Path) -> list[Step]:
    program = Program(build, "pose_graph_bench", "--benchmark_min_time=1.5")
    found = program.records("BM_OptimizePoseGraph/.*fix_scale:0/eigen:0")
    step = Step("essential_graph", "with scales (one camera); four and a half edges a keyframe")
    for n in SIZES:
        record = found[f"BM_OptimizePoseGraph/keyframes:{n}/fix_scale:0/eigen:0"]
        step.add(n, record["median_ms"], record["min_ms"])
    return [step]


def _full_adjustment(build: Path) -> list[Step]:
    found = Program(build, "global_bundle_bench").records("BM_GlobalBundle/stereo/")
    record = found[f"BM_GlobalBundle/stereo/{LIMIT_SIZE}"]
    step = Step(
        "full_adjustment",
        f"one thread; {record['points']:.0f} points, {record['observations']:.0f} observations, "
        f"{record['steps']:.0f} steps; in brackets processor time",
    )
    for n in SIZES:
        record = found[f"BM_GlobalBundle/stereo/{n}"]
        around = record["gather_ms"] + record["commit_ms"]
        step.add(n, around + 1e3 * record["solve_wall_s"], around + 1e3 * record["solve_s"])
    return [step]


_SOURCES = (_detection, _verification, _correction, _essential_graph, _full_adjustment)
_PROGRAMS = (
    "loop_detection_bench",
    "loops_bench",
    "loop_correction_bench",
    "pose_graph_bench",
    "global_bundle_bench",
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
            step.unit = Row(step.name, reference.LOOPS[step.key], measured, step.note)
        steps += found
    return steps


def missing_programs(build: Path) -> list[str]:
    """Programs that are not built."""
    return [name for name in _PROGRAMS if not (build / "benchmarks" / "cpp" / name).is_file()]


# ---- what is shown -------------------------------------------------------------------------------
def sizes_table(steps: list[Step]) -> object:
    """Milliseconds here by keyframes, and how they grow."""
    table = new_table(
        "The same by size of the map: ms here, and the exponent of the growth (1: linear)",
        ["step"],
        [f"{n}\nkeyframes" for n in SIZES] + [f"{a}\nto {b}" for a, b in itertools.pairwise(SIZES)],
    )
    for step in steps:
        cells = [f"{step.by_size[n].median:.3g}" for n in SIZES]
        table.add_row(step.name, *cells, *(f"{exponent:.2f}" for exponent in step.growth))
    table.caption = "Exponents of the least times (full adjustment: of processor time)."
    table.caption_justify = "left"
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


def rows(steps: list[Step]) -> Iterator[Row]:
    """Steps at the size of the limits."""
    return (step.unit for step in steps if step.unit is not None)


# ---- tracking meanwhile --------------------------------------------------------------------------
def tracking_table() -> object:
    """Tracking's times with and without full adjustments beside it, and theirs beside tracking."""
    command = [sys.executable, "-m", "benchmarks.loops.tracking", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    found = json.loads(done.stdout)
    table = new_table(
        f"Tracking in real time (every {found['period_ms']:.0f} ms) while the map of "
        f"{found['keyframes']} keyframes and {found['points']} points is adjusted",
        [""],
        ["measured", "limit", "met"],
    )
    p99 = []
    for name, key in (("without", "without_ms"), ("meanwhile", "during_ms")):
        values = np.percentile(found[key], (50, 95, 99))
        p99.append(float(values[2]))
        shown = " / ".join(f"{value:.1f}" for value in values)
        table.add_row(f"track ms {name}: median / p95 / p99", shown, "", "")
    ratio, most = p99[1] / p99[0], reference.ADJUSTMENT_TRACKING_RATIO
    table.add_row("p99 meanwhile / without", f"{ratio:.2f}", f"{most:g}", verdict(ratio <= most))
    seconds = found["adjustment_s"]
    limit = (reference.LOOPS["full_adjustment"].limit or 0) / 1e3
    if seconds:
        shown = f"{statistics.median(seconds):.1f} ({max(seconds):.1f})"
        table.add_row(
            "full adjustment s: median (longest)",
            shown,
            f"{limit:g}",
            verdict(max(seconds) < limit),
        )
    table.caption = (
        f"{len(found['without_ms'])} and {len(found['during_ms'])} frames of the same images; "
        f"{found['tracked']} of {found['frames']} tracked\n{len(seconds)} adjustments to their "
        f"end, {found['used']} used; accepted steps: {found['iterations']}\n"
        "Other programs disturb the ratio: it means something on an otherwise idle computer only."
    )
    table.caption_justify = "left"
    return table
