# SPDX-License-Identifier: BSD-3-Clause
"""The figures of a run: report.json."""

from __future__ import annotations

import resource
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py import __version__
from orbslam2py.evaluation import Evaluation, evaluate_trajectory
from orbslam2py.runner import RunResult
from orbslam2py.sensor import Sensor


@dataclass(frozen=True)
class RunEvaluation:
    """A run against ground truth."""

    figures: Evaluation
    truth_timestamps: npt.NDArray[np.float64]
    """(n,) seconds."""
    truth_positions: npt.NDArray[np.float64]
    """(n, 3) in the estimate's frame [m]."""


def evaluate_run(result: RunResult) -> RunEvaluation | None:
    """Compare the last map's trajectory with the sequence's ground truth, if it has one."""
    raise NotImplementedError


def make_report(result: RunResult, evaluation: RunEvaluation | None) -> dict[str, Any]:
    """Everything report.json holds."""
    options = result.options
    n_done = len(result.rows)
    n_tracked = result.n_tracked
    report: dict[str, Any] = {
        "version": __version__,
        "sequence": result.sequence.name,
        "layout": result.sequence.layout,
        "sensor": options.sensor.value,
        "settings": result.settings.to_yaml(),
        "deterministic": options.deterministic,
        "realtime": options.realtime,
        "seed": options.seed,
        "frames": result.n_frames,
        "tracked": n_tracked,
        "tracked_fraction": n_tracked / result.n_frames,
        "skipped_frames": result.n_skipped,
        "dropped_frames": result.n_dropped,
        "keyframes": len(result.keyframes),
        "map_points": len(result.snapshot.point_ids),
        "loops_closed": result.n_loops_closed,
        "relocalisations": result.n_relocalizations,
        "resets": result.n_resets,
        "interrupted": result.interrupted,
        "seconds": result.seconds,
        "frames_per_second": _rate(n_done, result.seconds),
        "slam_frames_per_second": _rate(n_done, result.slam_seconds),
        "peak_memory_mb": peak_memory_mb(),
        "milliseconds": result.stages,
    }
    if evaluation is not None:
        report |= evaluation.figures.as_dict()
    return report


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far, in megabytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def _rate(count: int, seconds: float) -> float:
    return count / seconds if seconds > 0 else 0.0


__all__ = ["RunEvaluation", "Sensor", "evaluate_run", "make_report", "peak_memory_mb"]
