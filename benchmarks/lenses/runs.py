# SPDX-License-Identifier: BSD-3-Clause
"""A run through the judged camera and one through its reference."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any

import cv2

import orbslam2py as orb
from benchmarks.lenses.cases import FEATURES, Case, frames_of
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.settings import OrbSettings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


@dataclass(frozen=True)
class Row:
    """Figures of both runs; times are medians of tracking [ms]."""

    part: str
    name: str
    world: str
    sensor: str
    seed: int
    frames: int
    tracked: int
    tracked_reference: int
    ate: float  # [m]
    ate_reference: float
    milliseconds: float
    milliseconds_reference: float

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What the seeds of a row have in common."""
        return self.part, self.name, self.world, self.sensor


def _play(case: Case, made: Mapping[str, Any]) -> tuple[int, float, float]:
    """Frames with a pose, ATE [m] and tracking's median [ms]."""
    made = {"sensor": case.sensor, **made}
    sensor = made["sensor"]
    sequence = SyntheticSequence(
        SyntheticOptions(
            world=case.world,
            frames=frames_of(case.world),
            seed=case.seed,
            noise=2.0,
            depth_noise=0.005 if sensor in ("rgbd", "rig") else 0.0,
            **made,
        )
    )
    settings = replace(sequence.default_settings(), orb=OrbSettings(n_features=FEATURES))
    times = []
    system = orb.System(settings, sensor, deterministic=True)
    with system as slam:
        for i, timestamp in enumerate(sequence.timestamps.tolist()):
            images = sequence.load(i)
            given = images.cameras if sensor == "rig" else images
            times.append(slam.track(given, timestamp).milliseconds["track"])
    path = system.trajectory()
    tracked = int((~path.lost).sum())
    alignment = "sim3" if sensor == "mono" else "se3"
    judged = evaluate_trajectory(path, sequence.ground_truth(), alignment)
    ate = float("nan") if judged.ate is None else judged.ate.rmse
    return tracked, ate, statistics.median(times)


def row_of(case: Case) -> Row:
    """Play both, in one thread."""
    cv2.setNumThreads(1)
    tracked, ate, milliseconds = _play(case, case.judged)
    tracked_reference, ate_reference, milliseconds_reference = _play(case, case.reference)
    return Row(
        *case.row,
        case.seed,
        frames_of(case.world),
        tracked,
        tracked_reference,
        ate,
        ate_reference,
        milliseconds,
        milliseconds_reference,
    )


def all_rows(chosen: Sequence[Case], jobs: int) -> Iterator[Row]:
    """Rows as they are done."""
    if jobs == 1:
        yield from map(row_of, chosen)
        return
    # Not fork: the extension may have started threads.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        for future in as_completed([pool.submit(row_of, case) for case in chosen]):
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)
