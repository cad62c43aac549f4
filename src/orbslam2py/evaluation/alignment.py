# SPDX-License-Identifier: BSD-3-Clause
"""Alignment of an estimate with ground truth: the transform between worlds, and its choice."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from orbslam2py._arguments import member_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.trajectory import MAX_DIFFERENCE, Similarity, align, associate

#: Lengths that differ by more than this factor are those of one camera, not of a wrong baseline.
_OTHER_UNIT = 1.5
_FEWEST_POSES = 3  # from this number on, a scale differs from an error


class Alignment(str, Enum):
    """Alignment of the estimate with the ground truth, before the absolute error is computed."""

    SE3 = "se3"
    """Rotation and translation."""
    SIM3 = "sim3"
    """Rotation, translation and scale: for a single camera, which has no metric scale."""
    YAW = "yaw"
    """Rotation about the third axis, which is up in both worlds, and translation: for estimates
    with an IMU, whose errors of gravity then count."""
    NONE = "none"
    """No transform: both are in one world."""
    AUTO = "auto"
    """``sim3`` for a single camera without metres, ``se3`` for others;
    chosen by the lengths of the paths if the sensor is not known."""

    @classmethod
    def of(cls, value: Alignment | str) -> Alignment:
        """Take an alignment or its name.

        Raises
        ------
        DatasetError
            For an unknown name; the message lists the names.
        """
        return member_of(cls, value, "the alignment")

    @property
    def fewest_poses(self) -> int:
        """Matched poses from which on a distance to the truth says something."""
        return _FEWEST_POSES if self is Alignment.SIM3 else 2

    def __str__(self) -> str:
        return self.value


def differ_in_unit(points: FloatArray, targets: FloatArray) -> float | None:
    """Return the ratio of the units if lengths differ, as with a single camera.

    Parameters
    ----------
    points, targets
        Positions of the same moments, float64 (n, 3).

    Returns
    -------
    float or None
        The factor from `points` to `targets` if it is above 1.5 or below 1 / 1.5 and scaling by it
        at least halves the distance that is left; None else.
    """
    if len(points) < _FEWEST_POSES:
        return None
    rigid, scaled = align(points, targets), align(points, targets, with_scale=True)
    if 1 / _OTHER_UNIT <= scaled.scale <= _OTHER_UNIT:
        return None
    before, after = (
        float(np.linalg.norm(found.apply(points) - targets)) for found in (rigid, scaled)
    )
    return scaled.scale if after < 0.5 * before else None


@dataclass(frozen=True, eq=False)
class FitByTime:
    """The alignment of one path with another."""

    similarity: Similarity
    """From the world of the first to that of the second."""
    rows: IntArray
    """(k,) compared poses of the first path."""
    other_rows: IntArray
    """(k,) poses of the second path, at the same times."""


def fit_by_time(
    times: FloatArray,
    positions: FloatArray,
    other_times: FloatArray,
    other_positions: FloatArray,
    *,
    with_scale: bool,
    fewest: int = _FEWEST_POSES,
) -> FitByTime | None:
    """Align a path with another, by the poses at the same times (Umeyama, PAMI 1991).

    Parameters
    ----------
    times, other_times
        Seconds, float64 (n,) and (m,).
    positions, other_positions
        Float64 (n, 3) and (m, 3), each in its own world.
    with_scale
        The worlds may differ in their unit.
    fewest
        Poses at the same times (0.02 s) for the alignment of the paths.

    Returns
    -------
    FitByTime or None
        None if there are fewer.
    """
    i, j = associate(times, other_times, MAX_DIFFERENCE)
    if len(i) < fewest:
        return None
    return FitByTime(align(positions[i], other_positions[j], with_scale=with_scale), i, j)
