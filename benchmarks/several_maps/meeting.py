# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic worlds seen in pieces: which maps meet, which are joined falsely, and how exactly.

Every case runs with several seeds; the seed chooses wallpaper, the order of pieces and all random
draws. All of them can end in one map, also those with places that only look alike. The error is
that of all frames of the largest map, beside that of the same frames in their own order, uncut.

    python -m benchmarks.several_maps.meeting                              all cases, ten seeds
    python -m benchmarks.several_maps.meeting --cases kidnapped --sensors rgbd --seeds 3

Exits with 1 if a row misses its limits.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.harness.arguments import add_counts, add_sensors, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table, verdict
from benchmarks.several_maps.pieces import Pieces, covered
from orbslam2py import Sensor, System
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

FPS = 20.0
#: Limits: part of the seeds in which the maps have met, error by that of the uncut frames, part of
#: the visible frames with a pose in any map.
LEAST_MET = 0.9
MOST_ERROR = 1.3
LEAST_TRACKED = 0.95
#: Metres: a map that is wrong by more was joined where it must not be.
FALSE = 0.5

Order = list[int | None]


@dataclass(frozen=True)
class Case:
    """A world and the order in which its frames come."""

    name: str
    world: str
    order: Callable[[int, np.random.Generator], Order]
    """Of so many frames."""


def _kidnapped(n: int, _: np.random.Generator) -> Order:
    """Covered for three seconds and set down elsewhere; walks into the known part."""
    return [*range(int(0.29 * n)), *covered(3, 1 / FPS), *range(int(0.53 * n), n)]


def _shuffled(n: int, random: np.random.Generator) -> Order:
    """A lap in five pieces that overlap a little, in any order, the lens covered between them."""
    bounds = np.linspace(0, n, 6).astype(int)
    overlap = n // 10
    order: Order = []
    for k in random.permutation(5):
        first, last = max(0, bounds[k] - overlap), min(n, bounds[k + 1] + overlap // 2)
        order += [*covered(3, 1 / FPS), *range(int(first), int(last))]
    return order[len(covered(3, 1 / FPS)) :]


def _two_places(n: int, _: np.random.Generator) -> Order:
    """One corridor, the light goes off, another one, and the leg that both share found later."""
    return [*range(int(0.3 * n)), *covered(3, 1 / FPS), *range(int(0.5 * n), n)]


def _alike(n: int, _: np.random.Generator) -> Order:
    """Both of two rooms that look the same are known; set down in one of them."""
    return [*range(n), *covered(3, 1 / FPS), *range(int(0.8 * n), n)]


CASES = (
    Case("kidnapped", "corridor", _kidnapped),
    Case("repeating", "repeating-corridor", _kidnapped),
    Case("five-pieces", "corridor", _shuffled),
    Case("two-places", "figure-eight", _two_places),
    Case("alike", "two-rooms", _alike),
)


@dataclass(frozen=True)
class Outcome:
    """What became of one seed."""

    n_maps: int
    tracked: float
    error: float
    uncut: float
    violations: int

    @property
    def is_false(self) -> bool:
        """Whether the map is wrong by more than it can be without a false place."""
        return self.error > max(FALSE, 3 * self.uncut)


def run(case: Case, sensor: Sensor, seed: int) -> Outcome:
    """Run one seed, in pieces and uncut."""
    source = SyntheticSequence(
        SyntheticOptions(
            world=case.world, sensor=sensor, size=(320, 240), pace=2.0, fps=FPS, seed=seed
        )
    )
    n = len(source)
    order = case.order(n, np.random.default_rng(seed))
    used = sorted({index for index in order if index is not None})
    truth = np.array([source.T_wc(i)[:3, 3] for i in range(n)])
    errors = []
    for frames in (tuple(order), tuple(used)):
        pieces = Pieces(source, frames, 1 / FPS)
        with System(source.settings, sensor, deterministic=True, seed=seed) as system:
            pieces.track(system)
            paths = system.trajectories()
            largest = max(paths, key=lambda path: int(np.count_nonzero(~path.lost)))
            monocular = sensor is Sensor.MONOCULAR
            errors.append(pieces.error_of(largest, truth, monocular=monocular))
            if len(errors) == 1:
                n_maps, violations = len(system.maps), len(system.check_map())
                tracked = sum(int(np.count_nonzero(~path.lost)) for path in paths)
                tracked_part = tracked / pieces.n_seen
    return Outcome(n_maps, tracked_part, errors[0], errors[1], violations)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = new_parser(__doc__)
    parser.add_argument("--cases", nargs="*", default=[case.name for case in CASES])
    add_counts(parser, seeds=(10, "how many"))
    add_sensors(parser)
    add_width(parser)
    given = parser.parse_args(arguments)
    console = console_of(given)
    table = new_table(
        "Maps that meet",
        ("case", "sensor"),
        ("seeds", "one map", "false", "tracked", "ATE [m]", "uncut [m]", "met"),
    )
    good = True
    for case in (case for case in CASES if case.name in given.cases):
        for sensor in map(Sensor, given.sensors):
            outcomes = []
            for seed in range(given.seeds):
                outcomes.append(run(case, sensor, seed))
                console.print(f"{case.name} {sensor} seed {seed}: {outcomes[-1]}")
            met = sum(outcome.n_maps == 1 for outcome in outcomes)
            wrong = sum(outcome.is_false for outcome in outcomes)
            tracked = statistics.fmean(outcome.tracked for outcome in outcomes)
            error = statistics.median(outcome.error for outcome in outcomes)
            uncut = statistics.median(outcome.uncut for outcome in outcomes)
            fine = (
                met >= LEAST_MET * given.seeds
                and wrong == 0
                and tracked >= LEAST_TRACKED
                and error <= MOST_ERROR * uncut
                and not any(outcome.violations for outcome in outcomes)
            )
            good &= fine
            table.add_row(
                *(case.name, str(sensor), str(given.seeds), str(met), str(wrong)),
                *(f"{tracked:.3f}", f"{error:.4f}", f"{uncut:.4f}", verdict(fine)),
            )
    console.print(table)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
