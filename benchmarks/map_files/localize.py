# SPDX-License-Identifier: BSD-3-Clause
"""Sequences mapped, saved and loaded again: are they found, and how exactly?

    python -m benchmarks.map_files.localize SEQUENCE ...

For each sequence: the same frames localised in the map of the whole (tracked share; distance and
angle to the mapping run's poses), and the rest of it tracked in the map of its first part, extended
(frames until found; error of the whole against one run over everything, where there is truth).

Where a run makes several maps that do not meet, poses are compared within one map, and errors over
the frames that the largest map of the one run and of the extended one have in common.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import islice
from pathlib import Path

import numpy as np

from benchmarks.harness.arguments import new_parser
from orbslam2py import OrbSlamError, Sensor, System, TrackingState, open_sequence
from orbslam2py.datasets import Sequence
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import rotation_angles


def run(sequence: Sequence, first: int, last: int, **options: object) -> System:
    """Track some frames; the system has been shut down, with all results."""
    with System(sensor=sequence.sensor, deterministic=True, **options) as slam:  # type: ignore[arg-type]
        for frame in islice(iter(sequence), first, last):
            slam.track(frame.images, frame.timestamp)
    return slam


def joined(parts: list[Trajectory]) -> Trajectory:
    """The tracked frames of several runs in one map."""
    parts = [part.select(~part.lost) for part in parts]
    return Trajectory(
        np.concatenate([part.timestamps for part in parts]),
        np.concatenate([part.T_wc for part in parts]),
    )


def common(first: Trajectory, second: Trajectory) -> tuple[Trajectory, Trajectory]:
    """The frames that both have."""
    return (
        first.select(np.isin(first.timestamps, second.timestamps)),
        second.select(np.isin(second.timestamps, first.timestamps)),
    )


def ate_of(estimate: Trajectory, sequence: Sequence) -> float:
    """RMSE against ground truth [m]; NaN without it."""
    truth = sequence.ground_truth()
    monocular = sequence.sensor is Sensor.MONOCULAR
    try:
        if truth is None:
            return float("nan")
        alignment = Alignment.SIM3 if monocular else Alignment.SE3
        figures = evaluate_trajectory(estimate, truth, alignment)
    except OrbSlamError:
        return float("nan")
    return float("nan") if figures.ate is None else figures.ate.rmse


def localised(sequence: Sequence, n: int, path: Path, mapped: list[Trajectory]) -> str:
    """The same frames in the maps that they made, one trajectory each."""
    records = []
    with System(load_map=path, deterministic=True) as slam:
        slam.localization_mode = True
        for frame in islice(iter(sequence), n):
            records.append(slam.track(frame.images, frame.timestamp))
    ok = {r.timestamp: r for r in records if r.state is TrackingState.OK}
    known = {
        t: (number, T_wc)
        for number, one in enumerate(mapped)
        for t, T_wc in zip(one.timestamps[~one.lost], one.T_wc[~one.lost], strict=True)
    }
    found = [ok[t] for t in known if t in ok]
    same = [r for r in found if r.map_index == known[r.timestamp][0]]
    pairs = [(r.T_wc, known[r.timestamp][1]) for r in same]
    apart = [float(np.linalg.norm(a[:3, 3] - b[:3, 3])) for a, b in pairs]
    turned = np.degrees(rotation_angles(np.array([a[:3, :3].T @ b[:3, :3] for a, b in pairs])))
    return (
        f"tracked {len(ok) / len(records):.1%}, {len(found) / len(known):.1%} of the mapped "
        f"({len(found) - len(same)} in another of {len(mapped)} maps); apart "
        f"median {np.median(apart) * 100:.2f} cm, max {np.max(apart) * 100:.2f} cm, "
        f"{np.median(turned):.3f} and {np.max(turned):.3f} degrees"
    )


def extended(sequence: Sequence, n: int, folder: Path, mapped: list[Trajectory]) -> str:
    """The second half in the map of the first; the largest map counts."""
    path, half = folder / "half.orbmap", n // 2
    first = run(sequence, 0, half, settings=sequence.settings)
    first.save_map(path)
    second = run(sequence, half, n, load_map=path)
    rest = second.trajectory()
    found = int(np.argmin(rest.lost)) if not rest.lost.all() else len(rest)
    tracked = 1 - float(np.mean(rest.lost[found:])) if found < len(rest) else 0.0
    saved = second.saved_map()
    numbers = range(np.count_nonzero(saved.contents.keyframes.parent < 0))  # roots
    parts = [joined([saved.trajectory(run, m) for run in (0, 1)]) for m in numbers]
    whole = [joined([one]) for one in mapped]
    both = common(max(parts, key=len), max(whole, key=len))
    ate, ate_of_one = (ate_of(trajectory, sequence) for trajectory in both)
    return (
        f"found after {found} frames, then tracked {tracked:.1%}; ate {ate:.4f} m, one run over "
        f"everything {ate_of_one:.4f} m, {ate / ate_of_one:.2f} times, {len(both[0])} frames"
    )


def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--sensor", choices=[str(s) for s in Sensor], help="[the richest there is]")
    parser.add_argument("--frames", type=int, help="only so many frames of each")
    arguments: argparse.Namespace = parser.parse_args()
    for place in arguments.sequences:
        sequence = open_sequence(place, arguments.sensor)
        n = min(arguments.frames or len(sequence), len(sequence))
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            one = run(sequence, 0, n, settings=sequence.settings)
            path = folder / "whole.orbmap"
            one.save_map(path)
            every = one.trajectories()
            # Numbered as in the file, which does not hold maps that were given up.
            mapped = [every[living.map_index] for living in one.maps]
            print(f"{sequence.name}, {sequence.sensor}: {localised(sequence, n, path, mapped)}")
            print(f"    extended: {extended(sequence, n, folder, mapped)}", flush=True)


if __name__ == "__main__":
    main()
