# SPDX-License-Identifier: BSD-3-Clause
"""Keypoints of coarse levels at their true place, and where the original puts them.

Every sequence that has a ground truth is run with both, deterministic, with every sensor that its
folder serves: the ATE, and the error over one frame, in which the place of a keypoint shows most.
With depth also what is left of the ATE when the path has a scale of its own, and by how much that
scale is off: a baseline or a focal length that is not exact makes every path too long or too short.
Runs that begin a few frames later say how much a figure varies by itself. Recordings have a
calibration and a truth that are off themselves; `--made-up` takes streets whose truth is exact,
with as many seeds as `--starts` says.

    python -m benchmarks.accuracy.coordinates --starts 3
    python -m benchmarks.accuracy.coordinates --made-up --starts 5 --sensors stereo
    python -m benchmarks.accuracy.coordinates --sequences ~/rgbd_dataset_freiburg1_desk
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.harness.arguments import add_counts, add_sensors, add_width, console_of, new_parser
from benchmarks.harness.folders import needed_shared_folder
from benchmarks.harness.tables import new_table
from orbslam2py import DatasetError, Sensor, SettingsError, System, Trajectory, open_sequence
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import Sequence
from orbslam2py.evaluation import align, match_poses, relative_errors
from orbslam2py.settings import Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

_FEWEST = 5  # poses that say something
_MADE_UP_SIZES = ((1241, 376), (640, 480), (620, 188))
_FOLLOWS = 1.5  # a pose belongs to the next image if it comes within so many median intervals


@dataclass(frozen=True)
class Errors:
    """What one run was off by; RMSE, metres and degrees."""

    ate: float
    shape: float
    """ATE of the path after an alignment with scale."""
    length: float
    """By how much of it the path is too long [percent]."""
    step: float
    step_degrees: float
    tracked: float
    keyframes: int


def errors_of(sequence: Sequence, start: int, *, original: bool) -> Errors | None:
    """One deterministic run of a sequence; None if it has too few poses to be judged."""
    truth = sequence.ground_truth()
    assert truth is not None
    settings = with_coordinates(sequence.settings, original=original)
    with System(settings, sequence.sensor, deterministic=True, seed=0) as slam:
        for index in range(start, len(sequence)):
            images, time = sequence.load(index), sequence.timestamps[index]
            if images.depth is not None:
                slam.track_rgbd(images.image, images.depth, time)
            elif images.right is not None:
                slam.track_stereo(images.image, images.right, time)
            else:
                slam.track_monocular(images.image, time)
        path, keyframes = slam.trajectory(), slam.n_keyframes
    path = path.select(~path.lost)
    judged = judge(path, truth, with_scale=sequence.sensor is Sensor.MONOCULAR)
    if judged is None:
        return None
    return Errors(*judged, len(path) / (len(sequence) - start), keyframes)


def with_coordinates(settings: Settings, *, original: bool) -> Settings:
    """The same settings with one of the two conventions."""
    return replace(settings, orb=replace(settings.orb, original_coordinates=original))


def judge(
    path: Trajectory, truth: Trajectory, *, with_scale: bool
) -> tuple[float, float, float, float, float] | None:
    """The first five of `Errors`, of a path without lost poses."""
    if len(path) < _FEWEST:
        return None
    i, j = match_poses(path, truth)
    if len(i) < _FEWEST:
        return None
    true = truth.T_wc[j]
    positions, places = path.T_wc[i][:, :3, 3], true[:, :3, 3]
    scaled = align(positions, places, with_scale=True)
    aligned = scaled if with_scale else align(positions, places)
    poses = aligned.apply_to_poses(path.T_wc[i])
    gaps = np.diff(path.timestamps[i])
    steps = np.flatnonzero(gaps < _FOLLOWS * np.median(gaps))
    metres, radians = relative_errors(poses, true, (steps, steps + 1))
    ate, shape = (
        _rms(np.linalg.norm(found.apply(positions) - places, axis=1)) for found in (aligned, scaled)
    )
    too_long = 0.0 if with_scale else 100 * (1 / scaled.scale - 1)
    return ate, shape, too_long, _rms(metres), float(np.degrees(_rms(radians)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def rows_of(name: str, begun: list[tuple[Sequence, int]]) -> Iterator[tuple[str, ...]]:
    """One row for each convention, then the ratio of the medians.

    Parameters
    ----------
    name : str
        Of the sequences.
    begun : list of Sequence, int
        The sequence, and its first frame.
    """
    medians = []
    sequence = begun[0][0]
    for original in (True, False):
        runs = [errors_of(each, start, original=original) for each, start in begun]
        judged = [run for run in runs if run is not None]
        if not judged:
            yield (name, str(sequence.sensor), _named(original), "no path")
            return
        columns = [[getattr(run, field) for run in judged] for field in ERRORS]
        medians.append([statistics.median(column) for column in columns])
        yield (
            name,
            str(sequence.sensor),
            _named(original),
            *(_spread(column) for column in columns),
            f"{100 * min(run.tracked for run in judged):.0f} %",
            str(statistics.median_low([run.keyframes for run in judged])),
        )
    before, after = medians
    ratios = [
        "" if name == "length" else f"{new / old:.3f}"
        for name, old, new in zip(ERRORS, before, after, strict=True)
    ]
    yield ("", "", "ratio", *ratios)


ERRORS = ("ate", "shape", "length", "step", "step_degrees")


def _named(original: bool) -> str:
    return "the original's" if original else "true places"


def _spread(values: list[float]) -> str:
    middle = f"{statistics.median(values):.5f}"
    if len(values) == 1:
        return middle
    return f"{middle} ({min(values):.5f}..{max(values):.5f})"


def judged_sequences(folders: Iterable[Path], sensors: Iterable[str]) -> Iterator[Sequence]:
    """The sequences that have a ground truth, with every sensor that they serve."""
    for folder in folders:
        for sensor in sensors:
            try:
                sequence = open_sequence(folder, sensor)
            except (DatasetError, SettingsError):
                continue  # not a sequence, or not for this sensor
            if sequence.ground_truth() is not None:
                yield sequence


def made_up_streets(sensors: Iterable[str], n_seeds: int) -> Iterator[tuple[str, list[Sequence]]]:
    """Names and sequences of made-up streets, each with several seeds."""
    for sensor in sensors:
        for width, height in _MADE_UP_SIZES:
            options = SyntheticOptions(
                world="street", sensor=sensor, frames=50, size=(width, height), noise=1.5
            )
            seeds = [SyntheticSequence(replace(options, seed=seed)) for seed in range(n_seeds)]
            yield f"street, {width} x {height}", list(seeds)


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(parser, starts=(1, "first frames that runs begin with"))
    parser.add_argument(
        "--sequences", nargs="+", type=Path, help="folders [those shared by the tests]"
    )
    parser.add_argument("--made-up", action="store_true", help="made-up streets instead")
    add_sensors(parser)
    add_width(parser)
    arguments = parser.parse_args()
    console = console_of(arguments)
    table = new_table(
        "Places of keypoints: RMSE against the truth, median (least..most)",
        ["sequence", "sensor", "keypoints"],
        [
            "ATE [m]",
            "ATE, own\nscale [m]",
            "too long\nby [%]",
            "over one\nframe [m]",
            "over one\nframe [deg]",
            "tracked",
            "keyframes",
        ],
    )
    for name, begun in chosen(arguments):
        for row in rows_of(name, begun):
            table.add_row(*row)
    console.print(table)


def chosen(arguments: argparse.Namespace) -> Iterator[tuple[str, list[tuple[Sequence, int]]]]:
    """Names, and what is run under each."""
    if arguments.made_up:
        for name, sequences in made_up_streets(arguments.sensors, arguments.starts):
            yield name, [(sequence, 0) for sequence in sequences]
        return
    folders = arguments.sequences or sorted((needed_shared_folder() / "sequences").iterdir())
    for sequence in judged_sequences(folders, arguments.sensors):
        yield sequence.name, [(sequence, start) for start in range(arguments.starts)]


if __name__ == "__main__":
    main()
