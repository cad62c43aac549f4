# SPDX-License-Identifier: BSD-3-Clause
"""Short synthetic sequences of small images, rendered once per test run."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from orbslam2py import Sensor, System, TrackingRecord
from orbslam2py.datasets import Images
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.feeding import blackened, feed

SIZE = (320, 240)

#: Frames of `write_fast_part`.
N_FAST = 24


@lru_cache
def sequence(sensor: Sensor, frames: int = 80) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(world="corridor", sensor=sensor, frames=frames, size=SIZE)
    )


def write_fast_part(folder: Path, sensor: Sensor) -> Path:
    """The beginning of the corridor at twice the pace, as files."""
    options = SyntheticOptions(world="corridor", sensor=sensor, frames=N_FAST, size=SIZE, speed=2.0)
    return SyntheticSequence(options).write(folder)


@lru_cache
def images(sensor: Sensor, index: int) -> Images:
    return sequence(sensor).load(index)


def new_system(sensor: Sensor, **options: object) -> System:
    return System(sequence(sensor).settings, sensor, **options)  # type: ignore[arg-type]


def track(
    system: System,
    index: int,
    *,
    timestamp: float | None = None,
    shown: Images | None = None,
    details: bool = False,
) -> TrackingRecord:
    """Track a frame, or other images in its place."""
    sensor = system.sensor
    seconds = float(sequence(sensor).timestamps[index]) if timestamp is None else timestamp
    return feed(system, shown or images(sensor, index), seconds, details=details)


def play(
    system: System, n_frames: int, first: int = 0, *, settled: bool = False
) -> list[TrackingRecord]:
    """Track frames in a row.

    An idle mapper takes more keyframes than a busy one. `settled` waits for it after every image:
    what becomes a keyframe does not depend on the speed of the machine then.
    """
    records = []
    for i in range(first, first + n_frames):
        records.append(track(system, i))
        assert not settled or system.wait_until_idle(20)
    return records


def black(sensor: Sensor) -> Images:
    """Images in which nothing can be seen."""
    return blackened(images(sensor, 0))


@lru_cache
def elsewhere(sensor: Sensor) -> Images:
    """Images of another place, with as much to be seen."""
    options = SyntheticOptions(world="table-top", sensor=sensor, frames=10, size=SIZE)
    return SyntheticSequence(options).load(0)


def ate(system: System) -> float:
    truth = sequence(system.sensor).ground_truth()
    return float(evaluate_trajectory(system.trajectory(), truth).as_dict()["ate_rmse_m"])
