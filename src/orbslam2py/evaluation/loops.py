# SPDX-License-Identifier: BSD-3-Clause
"""Closed loops against ground truth: true loops, and missed revisits of places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation.matching import match_poses, time_order
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, align, lengths_along
from orbslam2py.trajectory.rotations import inverse_poses, rotation_angles

# Largest difference between the ground truth and the measurement of a true loop.
_TOLERANCE_METRES = 0.3
_TOLERANCE_OF_DISTANCE = 0.02
_TOLERANCE_DEGREES = 10.0


@dataclass(frozen=True)
class LoopError:
    """The error of a loop's relative pose.

    Attributes
    ----------
    distance_m
        True distance of the two cameras [m].
    translation_m
        Distance of the estimated from the true position of the current camera, both in the frame of
        the matched one [m].
    rotation_deg
        Angle between its estimated and its true orientation [deg].
    """

    distance_m: float
    translation_m: float
    rotation_deg: float

    @property
    def is_true(self) -> bool:
        """Whether the loop is true: errors within 0.3 m plus 2 % of the distance, and 10 deg."""
        tolerance = _TOLERANCE_METRES + _TOLERANCE_OF_DISTANCE * self.distance_m
        return self.translation_m <= tolerance and self.rotation_deg <= _TOLERANCE_DEGREES


@dataclass(frozen=True)
class Revisit:
    """A period in which the camera is at known places.

    Attributes
    ----------
    begin, end
        First and last time stamp [s].
    """

    begin: float
    end: float

    def seconds_from(self, timestamp: float) -> float:
        """Return how long before or after it a time stamp is; 0 within it."""
        return max(self.begin - timestamp, timestamp - self.end, 0.0)


def loop_error(
    S_cm: FloatArray, true_T_wc: FloatArray, true_T_wm: FloatArray, *, metres_per_unit: float = 1.0
) -> LoopError:
    """Compare a loop with the ground truth.

    Parameters
    ----------
    S_cm
        The loop: similarity (4, 4) from the matched to the current camera. Its scale is the drift
        of the unit of length between the two; the translation is divided by it.
    true_T_wc, true_T_wm
        True poses of the current and of the matched camera, camera to world (4, 4) [m].
    metres_per_unit
        Scale of the map around the matched keyframe, see `metres_per_unit_at`; 1 except for a
        single camera.
    """
    scale = np.cbrt(np.linalg.det(S_cm[:3, :3]))
    # Of the similarity: position and axes of the present camera in the matched one.
    R_mc = S_cm[:3, :3].T / scale
    claimed = -R_mc @ S_cm[:3, 3] / scale * metres_per_unit
    T_mc = inverse_poses(true_T_wm) @ true_T_wc
    angle = rotation_angles((R_mc.T @ T_mc[:3, :3])[None])[0]
    return LoopError(
        distance_m=float(np.linalg.norm(T_mc[:3, 3])),
        translation_m=float(np.linalg.norm(claimed - T_mc[:3, 3])),
        rotation_deg=float(np.degrees(angle)),
    )


def metres_per_unit_at(
    timestamp: float,
    estimate: Trajectory,
    truth: Trajectory,
    reach: float,
    *,
    max_difference: float = MAX_DIFFERENCE,
) -> float:
    """Measure the scale of a single camera's map around a time.

    Parameters
    ----------
    timestamp
        The time [s].
    estimate
        Lost poses are left out.
    truth
        True poses of the same camera in any world [m].
    reach
        Poses within this distance along the true path, before and after, are used [m].
    max_difference
        Largest difference of matching time stamps [s].

    Raises
    ------
    DatasetError
        If no time stamps match, or fewer than three poses are within this distance.
    """
    estimate = estimate.select(~estimate.lost)
    truth = truth.select(~truth.lost)
    truth = truth.select(time_order(truth))
    i, j = match_poses(estimate, truth, max_difference)
    along = lengths_along(truth.positions)
    near = np.abs(along[j] - along[_nearest(truth, timestamp)]) <= reach
    if near.sum() < 3:
        raise DatasetError(
            f"fewer than three poses within {reach:.2f} m of where the camera was at "
            f"{timestamp:.3f} s show no scale"
        )
    return align(estimate.positions[i[near]], truth.positions[j[near]], with_scale=True).scale


def find_revisits(
    truth: Trajectory, *, near: float, apart: float, degrees: float = 30.0
) -> list[Revisit]:
    """Find when the camera is at a known place with the same viewing direction.

    Parameters
    ----------
    truth
        True poses, camera to world with z ahead [m].
    near
        Largest distance of two positions at the same place [m].
    apart
        Length of path that must be between the two visits [m]; shorter gaps do not end a visit.
    degrees
        Largest angle between two views of the same direction [deg].
    """
    truth = truth.select(time_order(truth))
    along = lengths_along(truth.positions)
    ahead = truth.T_wc[:, :3, 2]
    found = np.zeros(len(truth), bool)
    for k in range(len(truth)):
        earlier = along <= along[k] - apart
        distances = np.linalg.norm(truth.positions[earlier] - truth.positions[k], axis=1)
        same_direction = ahead[earlier] @ ahead[k] >= np.cos(np.radians(degrees))
        found[k] = bool(np.any((distances <= near) & same_direction))
    spans: list[list[int]] = []
    for k in np.flatnonzero(found).tolist():
        if spans and along[k] - along[spans[-1][1]] < apart:
            spans[-1][1] = k
        else:
            spans.append([k, k])
    return [Revisit(float(truth.timestamps[a]), float(truth.timestamps[b])) for a, b in spans]


def closed_revisits(revisits: Sequence[Revisit], timestamps: FloatArray) -> NDArray[np.bool_]:
    """Return for every revisit whether a true loop belongs to it.

    A loop may close slightly before or after, because a place is visible from a distance: it
    belongs to the revisit nearest in time.

    Parameters
    ----------
    revisits
        From `find_revisits`.
    timestamps
        Time stamps of the current cameras of the true loops, (l,) [s].

    Returns
    -------
    NDArray
        One for each revisit, (r,).
    """
    closed = np.zeros(len(revisits), bool)
    if len(revisits):
        for timestamp in timestamps:
            away = [revisit.seconds_from(float(timestamp)) for revisit in revisits]
            closed[int(np.argmin(away))] = True
    return closed


def _nearest(trajectory: Trajectory, timestamp: float) -> int:
    return int(np.argmin(np.abs(trajectory.timestamps - timestamp)))
