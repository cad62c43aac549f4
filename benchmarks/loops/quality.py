# SPDX-License-Identifier: BSD-3-Clause
"""Loops of synthetic worlds: which are closed, whether they are true, and what drift they leave.

Every case runs with several seeds; the seed chooses wallpaper, noise and all random draws. Loops
are judged against the exact poses, and the map by the motion from the start of the lap to its end.
Without loop closing a few of the seeds run again, to show the drift there is.

    python -m benchmarks.loops.quality                                     all cases, ten seeds
    python -m benchmarks.loops.quality --cases corridor --sensors rgbd --seeds 3
    python -m benchmarks.loops.quality --cases two-rooms --sensors mono --first-image 196
    python -m benchmarks.loops.quality --list

Versions whose maps begin at different images are compared over the images that both track
(``--first-image``).

Exits with 1 if a row misses its limits.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rich.table import Table

from benchmarks.harness.arguments import (
    add_counts,
    add_sensors,
    add_width,
    console_of,
    new_parser,
)
from benchmarks.harness.tables import new_table, verdict
from benchmarks.loops.cases import CASES, Case
from orbslam2py import DatasetError, Sensor, Trajectory
from orbslam2py.evaluation import (
    Alignment,
    LoopError,
    closed_revisits,
    evaluate_trajectory,
    find_revisits,
    lap_error,
    loop_error,
    metres_per_unit_at,
    scale_drift,
)
from orbslam2py.runs import RunResult

#: A revisit has to be closed in so many of the runs.
LEAST_CLOSED = 0.9
#: Limits of the error from start to end [percent of the lap] and of the change of scale [percent].
MOST_LAP_PERCENT = 0.3
MOST_SCALE_PERCENT = 1.0


@dataclass(frozen=True)
class Task:
    """One run."""

    case: Case
    seed: int
    loop_closing: bool
    deterministic: bool
    first_image: int = 0
    """The ATE is that of the path from here on."""


@dataclass(frozen=True)
class JudgedLoop:
    """A closed loop, and how far it is from the truth."""

    timestamp: float
    """Of the present keyframe [s]."""
    error: LoopError


@dataclass
class Outcome:
    """What one run gave."""

    closed: list[bool] = field(default_factory=list)
    """For every place seen again."""
    true: list[JudgedLoop] = field(default_factory=list)
    false: list[JudgedLoop] = field(default_factory=list)
    lap_percent: float | None = None
    """None where there is no lap, or tracking did not last for one."""
    scale_percent: float | None = None
    ate: float | None = None
    tracked: float = 0.0
    n_maps: int = 0
    seconds: float = 0.0
    failure: str = ""

    @property
    def n_loops(self) -> int:
        """All that were closed."""
        return len(self.true) + len(self.false)


# ---- one run -------------------------------------------------------------------------------------
def carry_out(task: Task) -> Outcome:
    """Run and judge."""
    case = task.case
    sequence = case.sequence(task.seed)
    begin = time.perf_counter()
    result = case.run(
        sequence, task.seed, loop_closing=task.loop_closing, deterministic=task.deterministic
    )
    truth = sequence.ground_truth()
    outcome = Outcome(seconds=time.perf_counter() - begin, n_maps=len(result.trajectories))
    outcome.tracked = result.n_tracked / len(truth)
    if result.error is not None:
        outcome.failure = str(result.error)
    _judge_loops(outcome, case, result, truth)
    estimate = result.tracked_trajectory()
    judged = estimate.timestamps >= truth.timestamps[task.first_image]
    _judge_path(outcome, case, estimate.select(judged), truth)
    if sequence.lap_length is not None:
        _judge_lap(outcome, case, estimate, truth, sequence.lap_length)
    return outcome


def _judge_loops(outcome: Outcome, case: Case, result: RunResult, truth: Trajectory) -> None:
    places = find_revisits(truth, near=case.near, apart=case.apart)
    if len(places) != case.n_revisits:
        raise ValueError(f"{case}: {len(places)} places are seen again, not {case.n_revisits}")
    for loop in result.loops:
        unit = 1.0
        if case.sensor is Sensor.MONOCULAR:
            estimate = result.trajectories[loop.map_index]
            unit = metres_per_unit_at(loop.matched_timestamp, estimate, truth, 2 * case.near)
        true_T_wc = _pose_at(truth, loop.current_timestamp)
        true_T_wm = _pose_at(truth, loop.matched_timestamp)
        error = loop_error(loop.S_cm, true_T_wc, true_T_wm, metres_per_unit=unit)
        judged = outcome.true if error.is_true else outcome.false
        judged.append(JudgedLoop(loop.current_timestamp, error))
    closing_times = np.array([loop.timestamp for loop in outcome.true])
    outcome.closed = closed_revisits(places, closing_times).tolist()


def _pose_at(truth: Trajectory, timestamp: float) -> np.ndarray:
    return truth.T_wc[int(np.argmin(np.abs(truth.timestamps - timestamp)))]


def _judge_path(outcome: Outcome, case: Case, estimate: Trajectory, truth: Trajectory) -> None:
    alignment = Alignment.SIM3 if case.sensor is Sensor.MONOCULAR else Alignment.SE3
    try:
        evaluation = evaluate_trajectory(estimate, truth, alignment)
    except DatasetError as error:
        outcome.failure = outcome.failure or str(error)
        return
    outcome.ate = None if evaluation.ate is None else evaluation.ate.rmse


def _judge_lap(
    outcome: Outcome, case: Case, estimate: Trajectory, truth: Trajectory, lap: float
) -> None:
    single = case.sensor is Sensor.MONOCULAR
    try:
        outcome.lap_percent = lap_error(estimate, truth, lap, with_scale=single).percent
        outcome.scale_percent = 100 * scale_drift(estimate, truth, lap)
    except DatasetError as error:
        outcome.failure = outcome.failure or str(error)


def carry_out_all(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """In the order of the tasks."""
    if jobs == 1:
        yield from map(carry_out, tasks)
        return
    # A fresh process each: threads of one run are no part of another.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        yield from pool.map(carry_out, tasks)


# ---- a row ---------------------------------------------------------------------------------------
def is_met(case: Case, outcomes: Sequence[Outcome]) -> bool:
    """Whether the runs with loop closing keep the limits."""
    if any(outcome.false or outcome.failure for outcome in outcomes):
        return False
    enough = LEAST_CLOSED * len(outcomes)
    if any(n < enough for n in times_closed(case, outcomes)):
        return False
    laps = [outcome for outcome in outcomes if case.n_revisits and all(outcome.closed)]
    if case.sensor is Sensor.MONOCULAR:
        return all(abs(lap.scale_percent or 0) < MOST_SCALE_PERCENT for lap in laps)
    return all((lap.lap_percent or 0) < MOST_LAP_PERCENT for lap in laps)


def times_closed(case: Case, outcomes: Sequence[Outcome]) -> list[int]:
    """In how many runs each place seen again made a true loop."""
    return [sum(outcome.closed[k] for outcome in outcomes) for k in range(case.n_revisits)]


def _spread(values: Iterable[float | None], digits: int, key: Callable[[float], float]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return ""
    return f"{statistics.median(known):.{digits}f} ({max(known, key=key):.{digits}f})"


def row_of(case: Case, with_loops: Sequence[Outcome], without: Sequence[Outcome]) -> list[str]:
    """Cells of the table."""
    loops = Counter(outcome.n_loops for outcome in with_loops)
    per_run = ", ".join(f"{n} x{count}" for n, count in sorted(loops.items()))
    closed = " ".join(f"{n}/{len(with_loops)}" for n in times_closed(case, with_loops))
    missed = sum(not closed for outcome in with_loops for closed in outcome.closed)
    cells = [case.name, str(case.sensor), closed or "none", str(missed)]
    cells += [str(sum(len(outcome.false) for outcome in with_loops)), per_run]
    for digits, name, key in (
        (2, "lap_percent", float),
        (2, "scale_percent", abs),
        (3, "ate", float),
    ):
        for outcomes in (with_loops, without):
            values = [getattr(outcome, name) for outcome in outcomes]
            cells.append(_spread(values, digits, key))  # type: ignore[arg-type]
    cells.append(f"{100 * min(outcome.tracked for outcome in with_loops):.0f} %")
    cells.append(f"{statistics.median(outcome.seconds for outcome in with_loops):.0f}")
    return [*cells, verdict(is_met(case, with_loops))]


def empty_table(n_seeds: int) -> Table:
    """Head of the table."""
    return new_table(
        f"Loops, {n_seeds} seeds; figures are medians (worst)",
        ["case", "sensor"],
        [
            "closed",
            "missed",
            "false",
            "loops\nper run",
            "end to start\n% of lap",
            "without\nloops",
            "scale drift\n% over lap",
            "without\nloops",
            "ATE m",
            "without\nloops",
            "tracked\n(least)",
            "s per\nrun",
            "met",
        ],
    )


def line_of(task: Task, outcome: Outcome) -> str:
    """One run in words."""
    mode = "loops" if task.loop_closing else "no loops"
    figures = {
        "closed": "".join("x" if closed else "-" for closed in outcome.closed) or "none",
        "false": len(outcome.false),
        "lap %": outcome.lap_percent and round(outcome.lap_percent, 3),
        "scale %": outcome.scale_percent and round(outcome.scale_percent, 3),
        "ate": outcome.ate and round(outcome.ate, 4),
        "tracked": round(outcome.tracked, 3),
        "maps": outcome.n_maps,
        "s": round(outcome.seconds),
    }
    words = ", ".join(f"{name} {value}" for name, value in figures.items())
    far = "".join(
        f"; FALSE at {loop.timestamp:.2f} s: {loop.error.translation_m:.2f} m, "
        f"{loop.error.rotation_deg:.1f} deg off"
        for loop in outcome.false
    )
    return f"{task.case}, seed {task.seed}, {mode}: {words}{far} {outcome.failure}".rstrip()


# ---- command line --------------------------------------------------------------------------------
def parse() -> argparse.Namespace:
    """Read the options."""
    parser = new_parser(__doc__)
    names = sorted({case.name for case in CASES})
    parser.add_argument(
        "--cases", nargs="+", choices=names, default=names, metavar="CASE", help="see --list"
    )
    add_sensors(parser)
    add_counts(
        parser,
        seeds=(10, "runs of every case"),
        first_seed=(0, "seed of the first of them"),
        first_image=(0, "the ATE is that of the path from here on"),
        without=(1, "of these, again without loops"),
        jobs=(1, "runs at the same time"),
    )
    parser.add_argument("--deterministic", action="store_true", help="mapping and loops inline")
    parser.add_argument("--list", action="store_true", help="only show the cases")
    add_width(parser, 200)
    arguments = parser.parse_args()
    if arguments.seeds < 1:
        parser.error("--seeds must be 1 or more")
    if arguments.first_image < 0:
        parser.error("--first-image must be 0 or more")
    return arguments


def tasks_of(case: Case, arguments: Any) -> list[Task]:
    """First with loop closing, then without."""
    first, seeds, without = arguments.first_seed, arguments.seeds, arguments.without
    runs = [(seed, True) for seed in range(seeds)]
    runs += [(seed, False) for seed in range(min(without, seeds))]
    deterministic, first_image = arguments.deterministic, arguments.first_image
    return [Task(case, first + seed, loops, deterministic, first_image) for seed, loops in runs]


def main() -> None:
    arguments = parse()
    chosen = [
        case
        for case in CASES
        if case.name in arguments.cases and str(case.sensor) in arguments.sensors
    ]
    console = console_of(arguments)
    if arguments.list:
        for case in chosen:
            console.print(f"{case}: {case.describe()}", highlight=False)
        return
    for case in chosen:
        if arguments.first_image >= len(case.sequence(arguments.first_seed)):
            sys.exit(f"--first-image {arguments.first_image}: {case} has fewer images")
    tasks = [task for case in chosen for task in tasks_of(case, arguments)]
    outcomes: dict[Case, list[tuple[Task, Outcome]]] = {case: [] for case in chosen}
    for task, outcome in zip(tasks, carry_out_all(tasks, arguments.jobs), strict=True):
        print(line_of(task, outcome), file=sys.stderr, flush=True)
        outcomes[task.case].append((task, outcome))
    table = empty_table(arguments.seeds)
    all_met = True
    for case, runs in outcomes.items():
        with_loops = [outcome for task, outcome in runs if task.loop_closing]
        without = [outcome for task, outcome in runs if not task.loop_closing]
        table.add_row(*row_of(case, with_loops, without))
        all_met = all_met and is_met(case, with_loops)
    console.print(table)
    sys.exit(0 if all_met else 1)


if __name__ == "__main__":
    main()
