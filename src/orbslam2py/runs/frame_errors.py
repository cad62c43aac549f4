# SPDX-License-Identifier: BSD-3-Clause
"""Error of every frame against the ground truth, and its largest values."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.runs.report import RunEvaluation
from orbslam2py.runs.result import RunResult
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, associate

#: Number of places that are listed, and their least distance as a part of the run.
_N_WORST, _APART = 4, 0.06


def position_errors(path: Trajectory, truth: Trajectory, metres: float) -> FloatArray:
    """Compute the distance of every pose to the true one at its time.

    Parameters
    ----------
    path, truth
        Both in one frame and unit.
    metres
        Length of that unit [m].

    Returns
    -------
    array of float64, (n,)
        Metres for every pose of `path`, nan without a true pose.
    """
    errors = np.full(len(path), np.nan)
    i, j = associate(path.timestamps, truth.timestamps, MAX_DIFFERENCE)
    errors[i] = metres * np.linalg.norm(path.positions[i] - truth.positions[j], axis=1)
    return errors


def worst_places(errors: FloatArray) -> IntArray:
    """Find the largest errors with some distance between them, the largest first.

    Parameters
    ----------
    errors
        In the order of the frames, (n,), nan if unknown.

    Returns
    -------
    array of int64, (k,)
        Indices; each is the largest error around it, and none is below the median.
    """
    known = np.isfinite(errors)
    if not known.any():
        return np.zeros(0, np.int64)
    left = np.where(known, errors, -np.inf)
    apart = max(1, int(_APART * len(errors)))
    floor = float(np.median(errors[known]))
    found: list[int] = []
    while len(found) < _N_WORST:
        worst = int(np.argmax(left))
        if not (left[worst] >= floor and left[worst] > 0):
            break
        around = errors[max(0, worst - apart) : worst + apart + 1]
        if errors[worst] >= np.nanmax(around):  # else it is the flank of one that was taken
            found.append(worst)
        left[max(0, worst - apart) : worst + apart + 1] = -np.inf
    return np.array(found, np.int64)


def worst_frames(result: RunResult, evaluation: RunEvaluation) -> IntArray:
    """Positions in `RunResult.rows` of the largest errors of a run, (k,)."""
    path = result.tracked_trajectory()
    return path.indices[worst_places(position_errors(path, evaluation.truth, 1.0))]


def truth_of_frames(result: RunResult, evaluation: RunEvaluation) -> tuple[Trajectory, list[str]]:
    """Return the true poses of frames, in the estimate's frame and unit.

    Returns
    -------
    truth, texts
        Poses at the times of the ground truth, and their time stamps for a file, with nanoseconds.
    """
    times = np.array([float(row.timestamp) for row in result.rows])
    _, j = associate(times, evaluation.truth.timestamps, MAX_DIFFERENCE)
    truth = evaluation.truth.select(np.unique(j))
    return truth, [f"{time:.9f}" for time in truth.timestamps]
