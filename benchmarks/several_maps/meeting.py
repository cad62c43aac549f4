# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic worlds seen in pieces: which maps meet, which are joined falsely, and how exactly.

Every case runs with several seeds; the seed chooses wallpaper, the order of pieces and all random
draws. All but `twin` can end in one map, also those with places that only look alike. The error is
that of all frames of the largest map, beside that of the same frames in the uncut sequence. Where
that closes a loop which the pieces leave open, drift is taken out of it that nothing could take
out of them: their error is judged by that of the same way in one go (*unbroken*). In `twin` the
places cannot be distinguished by their images: each piece is judged by itself.

    python -m benchmarks.several_maps.meeting                              all cases, ten seeds
    python -m benchmarks.several_maps.meeting --cases kidnapped --sensors rgbd --seeds 3
    python -m benchmarks.several_maps.meeting --rows build/meeting.jsonl   continues an interrupted
    run

Exits with 1 if a row misses its limits.
"""

from __future__ import annotations

import dataclasses
import itertools
import statistics
import sys
from dataclasses import dataclass

import numpy as np

from benchmarks.harness.arguments import add_counts, add_sensors, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table, verdict
from benchmarks.several_maps.cases import CASES, COVERED, FPS, Case, Rendered
from benchmarks.several_maps.pieces import Found, Order, Pieces, largest_of
from benchmarks.several_maps.rows import Row, Rows, add_rows
from orbslam2py import Sensor, System
from orbslam2py._arrays import FloatArray, IntArray

#: Limits: part of the seeds in which the maps have met, error by that of the uncut frames, part of
#: the visible frames with a pose in any map.
LEAST_MET = 0.9
MOST_ERROR = 1.3
LEAST_TRACKED = 0.95
#: Metres: a map that is wrong by more was joined where it must not be.
FALSE = 0.5


@dataclass(frozen=True)
class Outcome:
    """Outcome of one seed."""

    n_maps: int
    merges: int
    found_again: int
    """Times that tracking was found in a map by relocalization."""
    tracked: float
    error: float
    """Of the largest map."""
    worst: float
    """Of any map."""
    uncut: float
    violations: int
    scales: list[float]
    """Factors by which maps were scaled when they became part of others."""
    unbroken: float | None = None
    """Error of the same way in one go, where the uncut sequence closes a loop more."""

    @property
    def is_false(self) -> bool:
        """Whether a map is wrong by more than it can be without a false place."""
        return self.worst > max(FALSE, 3 * self.uncut)


def uncut(source: Rendered, order: Order, sensor: Sensor, seed: int) -> Row:
    """A sequence without darkness: frames and positions of its largest map."""
    pieces = Pieces(source, tuple(order), 1 / FPS)
    with System(source.settings, sensor, deterministic=True, seed=seed) as system:
        pieces.track(system)
        found = pieces.found(largest_of(system.trajectories()))
    return {"indices": found.indices.tolist(), "positions": found.positions.round(6).tolist()}


def run(case: Case, sensor: Sensor, seed: int, whole: Found) -> Outcome:
    """Run one seed in pieces; `whole` is what the uncut run found."""
    source = case.sequence(sensor, seed)
    order = case.order(len(source), np.random.default_rng(seed))
    truth = source.true_positions
    monocular = sensor is Sensor.MONOCULAR
    pieces = Pieces(source, tuple(order), 1 / FPS)
    with System(source.settings, sensor, deterministic=True, seed=seed) as system:
        pieces.track(system)
        paths = system.trajectories()
        outcome = Outcome(
            n_maps=len(system.maps),
            merges=len(system.merges),
            found_again=system.n_relocalizations,
            tracked=sum(int(np.count_nonzero(~path.lost)) for path in paths) / pieces.n_seen,
            error=pieces.found(largest_of(paths)).error(truth, monocular=monocular),
            worst=_worst([pieces.found(path) for path in paths], truth, monocular),
            uncut=whole.among(_used(order)).error(truth, monocular=monocular),
            violations=len(system.check_map()),
            scales=[merge.scale for merge in system.merges],
        )
    if case.can_be_told:
        return outcome
    # Which of the maps a piece is in is left open.
    by_piece = [
        pieces.found(path).among(some)
        for some in _frames_of_pieces(order)
        for path in [max(paths, key=lambda path: len(pieces.found(path).among(some)))]
    ]
    worst = _worst(by_piece, truth, monocular)
    return dataclasses.replace(outcome, error=worst, worst=worst)


def _worst(maps: list[Found], truth: FloatArray, monocular: bool) -> float:
    """The largest error of maps; those of a few frames have none."""
    return float(np.nanmax([0.0, *(found.error(truth, monocular=monocular) for found in maps)]))


def _used(order: Order) -> IntArray:
    return np.unique([index for index in order if index is not None])


def _frames_of_pieces(order: Order) -> list[IntArray]:
    """What is seen between two times of darkness."""
    breaks = [p for p in range(COVERED, len(order)) if order[p - COVERED : p] == [None] * COVERED]
    bounds = [0, *breaks, len(order)]
    return [_used(order[a:b]) for a, b in itertools.pairwise(bounds)]


def outcome_of(rows: Rows, case: Case, sensor: Sensor, seed: int) -> Outcome:
    """Run a seed, unless it stands in the rows."""

    def make() -> Row:
        source = case.sequence(sensor, seed)
        key = f"uncut {case.scene} {sensor} {seed}"
        row = rows.get(key, lambda: uncut(source, [*range(len(source))], sensor, seed))
        whole = Found(np.array(row["indices"], np.int64), np.array(row["positions"]))
        return dataclasses.asdict(run(case, sensor, seed, whole))

    row = rows.get(f"{case.name} {sensor} {seed}", make)
    outcome = Outcome(**{name: value for name, value in row.items() if name != "key"})
    unbroken = unbroken_error(rows, case, sensor, seed)
    return outcome if unbroken is None else dataclasses.replace(outcome, unbroken=unbroken)


def unbroken_error(rows: Rows, case: Case, sensor: Sensor, seed: int) -> float | None:
    """The error of the same way in one go; None where the uncut sequence is that."""
    if case.unbroken is None:
        return None
    way = case.unbroken

    def make() -> Row:
        source = case.sequence(sensor, seed)
        row = uncut(source, way(len(source)), sensor, seed)
        found = Found(np.array(row["indices"], np.int64), np.array(row["positions"]))
        monocular = sensor is Sensor.MONOCULAR
        return {"error": found.error(source.true_positions, monocular=monocular)}

    return float(rows.get(f"unbroken {case.name} {sensor} {seed}", make)["error"])


def judged(case: Case, outcomes: list[Outcome]) -> tuple[list[str], bool]:
    """Cells of the row of a case, and whether its limits are met."""
    met = sum(outcome.n_maps == 1 for outcome in outcomes)
    wrong = sum(outcome.is_false for outcome in outcomes)
    tracked = statistics.fmean(outcome.tracked for outcome in outcomes)
    error = statistics.median(outcome.error for outcome in outcomes)
    plain = statistics.median(outcome.uncut for outcome in outcomes)
    known = [o.uncut if o.unbroken is None else o.unbroken for o in outcomes]
    fair = statistics.median(known)
    fine = (
        (met >= LEAST_MET * len(outcomes) or not case.can_be_told)
        and wrong == 0
        and tracked >= LEAST_TRACKED
        and error <= MOST_ERROR * fair
        and not any(outcome.violations for outcome in outcomes)
    )
    numbers = [f"{tracked:.3f}", f"{error:.4f}", f"{plain:.4f}"]
    numbers += ["" if case.unbroken is None else f"{fair:.4f}", f"{error / fair:.2f}"]
    return [str(len(outcomes)), str(met), str(wrong), *numbers, verdict(fine)], fine


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = new_parser(__doc__)
    names = [case.name for case in CASES]
    parser.add_argument("--cases", nargs="+", choices=names, default=names, help="[all]")
    add_counts(parser, seeds=(10, "how many"))
    add_sensors(parser)
    add_rows(parser)
    add_width(parser)
    given = parser.parse_args(arguments)
    console = console_of(given)
    table = new_table(
        "Maps that meet",
        ("case", "sensor"),
        (
            "seeds",
            "one map",
            "false",
            "tracked",
            "ATE [m]",
            "uncut [m]",
            "unbroken [m]",
            "ratio",
            "met",
        ),
    )
    rows = Rows(given.rows)
    cases = [case for case in CASES if case.name in given.cases]
    sensors = [Sensor(sensor) for sensor in given.sensors]
    outcomes: dict[tuple[str, Sensor], list[Outcome]] = {}
    # Seeds go last: what is interrupted has some of every case. Cases of a scene come together,
    # whose images are kept.
    for seed in range(given.seeds):
        for sensor in sensors:
            for case in sorted(cases, key=lambda case: case.scene):
                outcome = outcome_of(rows, case, sensor, seed)
                outcomes.setdefault((case.name, sensor), []).append(outcome)
                console.print(f"{case.name} {sensor} seed {seed}: {outcome}")
    good = True
    for case in cases:
        for sensor in sensors:
            cells, fine = judged(case, outcomes[case.name, sensor])
            good &= fine
            table.add_row(case.name, str(sensor), *cells)
    console.print(table)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
