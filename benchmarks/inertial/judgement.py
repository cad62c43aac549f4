# SPDX-License-Identifier: BSD-3-Clause
"""A run with an IMU against one without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.inertial.cases import Case
from benchmarks.inertial.play import Run, play
from orbslam2py._arrays import FloatArray
from orbslam2py.synthetic import SyntheticSequence
from orbslam2py.trajectory import align


@dataclass(frozen=True)
class Row:
    """Figures of a run with an IMU; errors are of the frames that both runs have a pose of."""

    situation: str
    sensor: str
    seed: int
    chip: str
    tracked: int  # frames with a pose
    led: int  # of these, by the IMU alone
    tracked_without: int
    maps: int
    maps_without: int
    ate: float  # [m], every map of the run without the IMU aligned on its own
    ate_without: float
    ate_whole: float  # [m], all frames of the run with the IMU in one alignment; depth: rigid
    started: float | None
    up_error: float | None
    scale_error: float | None
    bias_error: float | None  # largest one, standard deviations
    nees: tuple[float, ...]
    fault: str


def rows_of(case: Case, chips: Sequence[str], config: Mapping[str, Any] | None = None) -> list[Row]:
    """Play a case and judge each chip."""
    without, *runs = play(case, chips, config)
    truth = SyntheticSequence(case.options(chips[0])).ground_truth().T_wc[:, :3, 3]
    mono = case.sensor == "mono"
    rows = []
    for chip, run in zip(chips, runs, strict=True):
        both = (run.map_index >= 0) & (without.map_index >= 0) & ~run.led
        rows.append(
            Row(
                case.situation.name,
                case.sensor,
                case.seed,
                chip,
                int((run.map_index >= 0).sum()),
                int(run.led.sum()),
                int((without.map_index >= 0).sum()),
                len(set(run.map_index.tolist()) - {-1}),
                len(set(without.map_index.tolist()) - {-1}),
                _ate(run, without, truth, both, mono),
                _ate(without, without, truth, both, mono),
                _whole(run, truth),
                run.started,
                run.up_error,
                run.scale_error,
                None if run.bias_errors is None else float(np.abs(run.bias_errors).max()),
                tuple(run.nees.mean(axis=0).tolist()) if len(run.nees) else (),
                run.fault,
            )
        )
    return rows


def _ate(run: Run, without: Run, truth: FloatArray, both: Any, with_scale: bool) -> float:
    errors = []
    pairs = np.stack([run.map_index, without.map_index], axis=1)
    for pair in np.unique(pairs[both], axis=0):
        rows = np.flatnonzero(both & (pairs == pair).all(axis=1))
        if len(rows) >= 5:
            errors.append(_distances(run, truth, rows, with_scale))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))) if errors else float("nan")


def _whole(run: Run, truth: FloatArray) -> float:
    """Every map aligned rigidly: with an IMU one camera knows metres."""
    errors = []
    for number in set(run.map_index.tolist()) - {-1}:
        rows = np.flatnonzero(run.map_index == number)
        if len(rows) >= 5:
            errors.append(_distances(run, truth, rows, False))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))) if errors else float("nan")


def _distances(run: Run, truth: FloatArray, rows: Any, with_scale: bool) -> FloatArray:
    found = align(run.centres[rows], truth[rows], with_scale=with_scale)
    return np.asarray(np.linalg.norm(found.apply(run.centres[rows]) - truth[rows], axis=1))
