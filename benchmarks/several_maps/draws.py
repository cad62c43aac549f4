# SPDX-License-Identifier: BSD-3-Clause
"""A lap cut into two to eight pieces at random places, in any order: nothing crashes or is lost.

    python -m benchmarks.several_maps.draws
    python -m benchmarks.several_maps.draws --draws 8 --frames 200

Every draw has its own process, seed and sensor; every second one runs with threads. The pieces do
not overlap, so that maps that are left need not be of one place. A frame is lost if it had a pose
when it was tracked and has none in the end, or one in two living maps; poses that were found again
and not confirmed by the next frame do not count.

Exits with 1 if a draw failed, hung, or lost a frame.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from functools import partial

import numpy as np

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table, verdict
from benchmarks.several_maps.cases import FPS
from benchmarks.several_maps.pieces import Order, Pieces
from benchmarks.several_maps.rows import Row, Rows, add_rows
from orbslam2py import System
from orbslam2py.settings.sensor import WITHOUT_RIG
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

FEWEST, MOST = 2, 8  # pieces
LONGEST_COVER = 4.0  # seconds
#: A draw that takes longer hangs.
TIMEOUT = 900.0


def order_of(n: int, n_pieces: int, random: np.random.Generator) -> Order:
    """Pieces between random places, in any order, covered for a random time before each."""
    bounds = [0, *sorted(random.choice(np.arange(1, n), n_pieces - 1, replace=False)), n]
    order: Order = []
    for k in random.permutation(n_pieces):
        order += [None] * int(random.integers(0, round(LONGEST_COVER * FPS)))
        order += range(int(bounds[k]), int(bounds[k + 1]))
    return order


def run(draw: int, frames: int | None) -> Row:
    """One draw, in this process."""
    n_pieces = FEWEST + draw % (MOST - FEWEST + 1)
    sensor = WITHOUT_RIG[draw % len(WITHOUT_RIG)]
    threaded = draw % 2 == 1
    source = SyntheticSequence(
        SyntheticOptions(
            world="corridor",
            sensor=sensor,
            size=(320, 240),
            pace=2.0,
            fps=FPS,
            seed=draw,
            frames=frames,
        )
    )
    order = order_of(len(source), n_pieces, np.random.default_rng(draw))
    pieces = Pieces(source, tuple(order), 1 / FPS)
    with System(source.settings, sensor, deterministic=not threaded, seed=draw) as system:
        records = pieces.track(system)
        paths = system.trajectories()
        living, violations = {there.map_index for there in system.maps}, len(system.check_map())
        merges = len(system.merges)
    poses, living_poses = np.zeros((2, len(order)), np.int64)
    for map_index, path in enumerate(paths):
        frames = pieces.positions_of(path.select(~path.lost))
        poses[frames] += 1
        living_poses[frames] += map_index in living
    tracked = np.array([r.T_cw is not None and not r.unconfirmed for r in records])
    largest = max(int(np.count_nonzero(~path.lost)) for path in paths)
    return {
        "pieces": n_pieces,
        "sensor": str(sensor),
        "threaded": threaded,
        "n_maps": len(living),
        "merges": merges,
        "seen": pieces.n_seen,
        "with_pose": int((poses > 0).sum()),
        "in_largest": largest,
        "lost": int((tracked & (poses == 0)).sum() + (living_poses > 1).sum()),
        "violations": violations,
        "failure": "",
    }


def run_apart(draw: int, frames: int | None) -> Row:
    """One draw in a separate process, with any outcome."""
    command = [sys.executable, "-m", "benchmarks.several_maps.draws", "--draw", str(draw)]
    command += [] if frames is None else ["--frames", str(frames)]
    about = {"pieces": FEWEST + draw % (MOST - FEWEST + 1), "threaded": draw % 2 == 1}
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return {**about, "failure": f"took longer than {TIMEOUT:.0f} s"}
    if done.returncode:
        return {**about, "failure": f"ended with {done.returncode}: {done.stderr[-500:]}"}
    row: Row = json.loads(done.stdout)
    return row


def cells_of(rows: list[Row]) -> tuple[list[str], bool]:
    """Cells of the row of a number of pieces, and whether nothing went wrong."""
    whole = [row for row in rows if not row["failure"]]
    failed = len(rows) - len(whole)
    lost = sum(row["lost"] for row in whole)
    fine = failed == 0 and lost == 0 and not any(row["violations"] for row in whole)
    left = [row["n_maps"] for row in whole] or [0]
    share = [row["with_pose"] / row["seen"] for row in whole] or [0.0]
    largest = [row["in_largest"] / row["seen"] for row in whole] or [0.0]
    return [
        str(len(rows)),
        str(failed),
        str(lost),
        f"{statistics.median(left):g} ({min(left)} to {max(left)})",
        str(sum(n == 1 for n in left)),
        f"{statistics.median(share):.3f}",
        f"{statistics.median(largest):.3f}",
        verdict(fine),
    ], fine


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = new_parser(__doc__)
    add_counts(parser, draws=(50, "how many"))
    parser.add_argument("--frames", type=int, help="only so many of the lap's [all]")
    parser.add_argument("--draw", type=int, help="this one alone; prints JSON")
    add_rows(parser)
    add_width(parser)
    given = parser.parse_args(arguments)
    if given.draw is not None:
        print(json.dumps(run(given.draw, given.frames)))
        return 0
    console = console_of(given)
    kept = Rows(given.rows)
    rows = []
    for draw in range(given.draws):
        key = f"{given.frames} {draw}"
        rows.append(kept.get(key, partial(run_apart, draw, given.frames)))
        console.print(rows[-1])
    table = new_table(
        "Cut into pieces at random places",
        ("pieces",),
        (
            *("draws", "failed", "frames lost", "maps left", "in one map"),
            *("with a pose", "in the largest map", "met"),
        ),
    )
    good = True
    for n_pieces in range(FEWEST, MOST + 1):
        some = [row for row in rows if row["pieces"] == n_pieces]
        if some:
            cells, fine = cells_of(some)
            good &= fine
            table.add_row(str(n_pieces), *cells)
    cells, fine = cells_of(rows)
    table.add_section()
    table.add_row("all", *cells)
    console.print(table)
    return 0 if good and fine else 1


if __name__ == "__main__":
    sys.exit(main())
