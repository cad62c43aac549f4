# SPDX-License-Identifier: BSD-3-Clause
"""Recorded sequences in pieces: how many of the frames that can be tracked end in one map.

    python -m benchmarks.several_maps.recorded
    python -m benchmarks.several_maps.recorded --only redkitchen --seeds 1

Each sequence is run uncut, and

    kidnapped   the lens is covered for three seconds, then the whole way is gone, through the part
                that was seen first
    jump        the same without the cover: from one image to the next
    black       a stretch of images is black; it is seen at last
    shuffled    in five pieces (three of short sequences) that overlap a little, in any order

A frame can be tracked if it is tracked in the uncut run. Demanded are 95 % of them in the largest
map; in `jump` those of the time for which only the old map is searched (`new_map_after`) are left
out.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.tables import new_table, verdict
from benchmarks.several_maps.pieces import Found, Order, Pieces, covered, largest_of, with_covered
from benchmarks.several_maps.rows import Row, Rows, add_rows
from orbslam2py import Sensor, System, open_sequence
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import Sequence
from orbslam2py.trajectory import associate

LEAST_SHARE = 0.95
COVER = 3.0  # seconds
PATIENCE = 2.0  # seconds, the default of new_map_after
SHORT = 100  # frames; sequences below are shuffled in three pieces


@dataclass(frozen=True)
class Recording:
    """A recorded sequence and the camera that it is seen with."""

    name: str
    folder: str
    sensor: Sensor

    def open(self) -> Sequence:
        """The sequence."""
        return open_sequence(sequence_folder(self.folder), self.sensor)


RECORDINGS = (
    Recording("redkitchen", "7scenes_redkitchen_head250", Sensor.RGBD),
    Recording("redkitchen", "7scenes_redkitchen_head250", Sensor.MONOCULAR),
    Recording("KITTI 06", "kitti_06_head51_stereo", Sensor.STEREO),
    Recording("KITTI 06", "kitti_06_head51_stereo", Sensor.MONOCULAR),
    Recording("KITTI 03", "kitti_03_left_head120", Sensor.MONOCULAR),
    Recording("KITTI raw 0001", "kitti_raw_0926_0001_left", Sensor.MONOCULAR),
    Recording("drone", "drone_semicircle", Sensor.MONOCULAR),
)

Random = np.random.Generator


def _parts(n: int, *bounds: tuple[float, float]) -> list[range]:
    return [range(round(first * n), round(last * n)) for first, last in bounds]


def kidnapped(n: int, n_covered: int, _: Random) -> Order:
    """Covered, then the whole way."""
    return with_covered(_parts(n, (0.4, 0.7), (0, 1)), n_covered)


def jump(n: int, _: int, __: Random) -> Order:
    """From one image to the next elsewhere."""
    return with_covered(_parts(n, (0.4, 0.7), (0, 1)), 0)


def black(n: int, n_covered: int, _: Random) -> Order:
    """A black stretch, seen at last, and a fifth of the sequence before and after it."""
    begin, end = round(0.4 * n), round(0.6 * n)
    hidden: Order = [None] * max(end - begin, n_covered)
    last = _parts(n, (0.2, 0.8))[0]
    return [*range(begin), *hidden, *range(end, n), *[None] * n_covered, *last]


def shuffled(n: int, n_covered: int, random: Random) -> Order:
    """Pieces that overlap, in any order."""
    k = 5 if n >= SHORT else 3
    bounds = np.linspace(0, n, k + 1).astype(int)
    pieces = []
    for piece in random.permutation(k):
        first, last = max(0, bounds[piece] - n // 10), min(n, bounds[piece + 1] + n // 10)
        pieces.append(range(int(first), int(last)))
    return with_covered(pieces, n_covered)


VERSIONS: tuple[Callable[[int, int, Random], Order], ...] = (kidnapped, jump, black, shuffled)


def true_positions(sequence: Sequence) -> FloatArray:
    """Positions (n, 3) of the frames, NaN where there is no truth."""
    positions = np.full((len(sequence), 3), np.nan)
    truth = sequence.ground_truth()
    if truth is not None:
        frames, poses = associate(sequence.timestamps, truth.timestamps, 0.02)
        positions[frames] = truth.positions[poses]
    return positions


def seconds_per_frame(sequence: Sequence) -> float:
    """The usual time between two images."""
    return float(np.median(np.diff(sequence.timestamps)))


def as_it_is(sequence: Sequence, seed: int) -> Row:
    """Run the sequence uncut; frames and positions of its largest map."""
    pieces = Pieces(sequence, tuple(range(len(sequence))), seconds_per_frame(sequence))
    with System(sequence.settings, sequence.sensor, deterministic=True, seed=seed) as system:
        pieces.track(system)
        found = pieces.found(largest_of(system.trajectories()))
    return {"indices": found.indices.tolist(), "positions": found.positions.round(6).tolist()}


def cut(sequence: Sequence, order: Order, whole: Found, seed: int, *, waits: bool) -> Row:
    """Run a cut version; `whole` is the result of the uncut run.

    `waits`: the images go on while only the old map is searched.
    """
    seconds = seconds_per_frame(sequence)
    truth = true_positions(sequence)
    pieces = Pieces(sequence, tuple(order), seconds)
    with System(sequence.settings, sequence.sensor, deterministic=True, seed=seed) as system:
        records = pieces.track(system)
        path = largest_of(system.trajectories())
        n_maps, merges, wrong = len(system.maps), len(system.merges), len(system.check_map())
    monocular = sequence.sensor is Sensor.MONOCULAR
    can = [index is not None and index in set(whole.indices.tolist()) for index in order]
    trackable = np.array(can)
    if waits:
        lost = [p for p, record in enumerate(records) if record.T_cw is None]
        begin = next((p for p in lost if p > 0 and order[p] != order[p - 1] + 1), len(order))  # type: ignore[operator]
        trackable[begin : begin + round(PATIENCE / seconds) + 1] &= False
    has_pose = np.zeros(len(order), bool)
    has_pose[pieces.positions_of(path.select(~path.lost))] = True
    used = np.unique([index for index in order if index is not None])
    return {
        "n_maps": n_maps,
        "merges": merges,
        "trackable": int(trackable.sum()),
        "in_one": int((trackable & has_pose).sum()),
        "error": pieces.found(path).error(truth, monocular=monocular),
        "uncut": whole.among(used).error(truth, monocular=monocular),
        "violations": wrong,
    }


def cells_of(rows: list[Row]) -> tuple[list[str], bool]:
    """Cells of the row of a version, and whether its limit is met by the median."""
    shares = [row["in_one"] / row["trackable"] for row in rows]
    error = statistics.median(row["error"] for row in rows)
    plain = statistics.median(row["uncut"] for row in rows)
    fine = statistics.median(shares) >= LEAST_SHARE and not any(r["violations"] for r in rows)
    one = sum(row["n_maps"] == 1 for row in rows)
    return [
        str(rows[0]["trackable"]),
        f"{statistics.median(shares):.3f} ({min(shares):.3f})",
        f"{one} of {len(rows)}",
        f"{error:.4f}" if np.isfinite(error) else "",
        f"{plain:.4f}" if np.isfinite(plain) else "",
        verdict(fine),
    ], fine


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = new_parser(__doc__)
    parser.add_argument("--only", metavar="NAME", help="sequences with this text in their name")
    add_counts(parser, seeds=(3, "how many of each"))
    add_rows(parser)
    add_width(parser)
    given = parser.parse_args(arguments)
    console = console_of(given)
    rows = Rows(given.rows)
    table = new_table(
        f"Recorded sequences in pieces, {given.seeds} seeds: median (least)",
        ("sequence", "sensor", "version"),
        ("trackable", "in one map", "one map left", "ATE [m]", "as it is [m]", "met"),
    )
    good = True
    for recording in (r for r in RECORDINGS if (given.only or "") in r.name):
        sequence = recording.open()
        n_covered = len(covered(COVER, seconds_per_frame(sequence)))
        for version in VERSIONS:
            outcomes = []
            for seed in range(given.seeds):
                name = f"{recording.name} {recording.sensor} {seed}"
                plain = rows.get(f"uncut {name}", partial(as_it_is, sequence, seed))
                whole = Found(np.array(plain["indices"], np.int64), np.array(plain["positions"]))
                order = version(len(sequence), n_covered, np.random.default_rng(seed))
                make = partial(cut, sequence, order, whole, seed, waits=version is jump)
                outcomes.append(rows.get(f"{version.__name__} {name}", make))
                console.print(outcomes[-1])
            cells, fine = cells_of(outcomes)
            good &= fine
            table.add_row(recording.name, str(recording.sensor), version.__name__, *cells)
    console.print(table)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
