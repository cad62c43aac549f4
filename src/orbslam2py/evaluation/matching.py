# SPDX-License-Identifier: BSD-3-Clause
"""Which poses of an estimate and of the ground truth are compared, and their share of the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, associate, lengths_along

_LONGEST_STEP = 1.0  # seconds between matched poses; what is longer, and unusual, is a gap
_UNUSUAL_STEP = 5.0  # times the median step


@dataclass(frozen=True)
class Matched:
    """The compared poses.

    Attributes
    ----------
    poses
        Pairs of an estimated and a true pose.
    estimate_poses, truth_poses
        Numbers of poses, without lost ones.
    first, last
        Time stamps of the first and the last matched pose of the estimate [s].
    path
        Length of the true path that they cover [m], without gaps. A gap is a step between matched
        poses of more than a second and more than five times the usual step.
    truth_path
        Length of the whole true path [m].
    median_difference, max_difference
        Differences of the time stamps of the pairs [s].
    is_timed
        Whether time stamps are seconds; otherwise numbers of frames.
    """

    poses: int
    estimate_poses: int
    truth_poses: int
    first: float
    last: float
    path: float
    truth_path: float
    median_difference: float
    max_difference: float
    is_timed: bool = True

    def __str__(self) -> str:
        part = f" ({100 * self.path / self.truth_path:.0f} %)" if self.truth_path > 0 else ""
        text = f"{self.poses} of {self.estimate_poses} poses matched, "
        text += (
            f"from {self.first:.3f} to {self.last:.3f} s, "
            if self.is_timed
            else f"from row {self.first:.0f} to {self.last:.0f}, "
        )
        text += f"over {self.path:.2f} of {self.truth_path:.2f} m of the true path{part}"
        if self.is_timed:
            text += (
                f"; time stamps of matched poses differ by {1e3 * self.median_difference:.2f} ms "
                f"(median) and {1e3 * self.max_difference:.2f} ms (largest)"
            )
        return text


def match_poses(
    estimate: Trajectory, truth: Trajectory, max_difference: float = MAX_DIFFERENCE
) -> tuple[IntArray, IntArray]:
    """Match the poses of two trajectories by their time stamps.

    Parameters
    ----------
    estimate, truth
        Both on one clock.
    max_difference
        Largest difference of matching time stamps [s].

    Returns
    -------
    i, j
        Indices into the estimate and into the truth, (k,) each, k > 0.

    Raises
    ------
    DatasetError
        If no time stamps match.
    """
    i, j = associate(estimate.timestamps, truth.timestamps, max_difference)
    if not len(i):
        raise DatasetError(
            f"no poses to compare: no time stamps of estimate ({_span(estimate)}) and ground truth "
            f"({_span(truth)}) differ by less than {max_difference} s{_remedy(estimate, truth)}"
        )
    return i, j


def time_order(trajectory: Trajectory) -> IntArray:
    """Order poses by their time stamps: files may have any order.

    The length of a path needs this order.

    Returns
    -------
    IntArray
        Indices of the poses, (n,); poses of equal time keep their order.
    """
    return np.argsort(trajectory.timestamps, kind="stable")


def describe_match(
    estimate: Trajectory, truth: Trajectory, i: IntArray, j: IntArray, *, timed: bool = True
) -> Matched:
    """Describe the result of `match_poses`.

    Parameters
    ----------
    estimate, truth
        Without lost poses, both on one clock.
    i, j
        Indices into both, (k,) each, k > 0.
    timed
        False if the time stamps are only frame numbers.
    """
    differences = np.abs(estimate.timestamps[i] - truth.timestamps[j])
    by_time = time_order(truth)
    with np.errstate(all="ignore"):
        along = lengths_along(truth.positions[by_time])
        place = np.empty(len(truth), np.int64)
        place[by_time] = np.arange(len(truth))
        matched = np.sort(place[j])
        steps = np.diff(truth.timestamps[by_time][matched])
        usual = float(np.median(steps)) if len(steps) else 0.0
        covered = steps <= max(_LONGEST_STEP if timed else 0.0, _UNUSUAL_STEP * usual)
        path = float(np.sum(np.diff(along[matched])[covered]))
    times = estimate.timestamps[i]
    return Matched(
        poses=len(i),
        estimate_poses=len(estimate),
        truth_poses=len(truth),
        first=float(times.min()),
        last=float(times.max()),
        path=path,
        truth_path=float(along[-1]),
        median_difference=float(np.median(differences)),
        max_difference=float(differences.max()),
        is_timed=timed,
    )


def _span(trajectory: Trajectory) -> str:
    if not len(trajectory):
        return "no poses"
    times = trajectory.timestamps
    return f"{len(times)} poses from {times.min():.3f} to {times.max():.3f} s"


def _remedy(estimate: Trajectory, truth: Trajectory) -> str:
    if not len(estimate) or not len(truth):
        return ""
    return "; if their clocks differ, give evaluate the seconds between them with --offset"
