# SPDX-License-Identifier: BSD-3-Clause
"""Closed loops against the truth: which are true, and which places seen again were missed."""

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

# How far the truth may be from what a true loop says.
_TOLERANCE_METRES = 0.3
_TOLERANCE_OF_DISTANCE = 0.02
_TOLERANCE_DEGREES = 10.0


@dataclass(frozen=True)
class LoopError:
    """How far a loop's relative pose is from the true one.

    Attributes
    ----------
    distance_m
        True distance of the two cameras [m].
    translation_m
        Distance of the claimed from the true position of the present camera, both seen from the
        matched one [m].
    rotation_deg
        Angle between its claimed and its true orientation [deg].
    """

    distance_m: float
    translation_m: float
    rotation_deg: float

    @property
    def is_true(self) -> bool:
        """The cameras are where the loop says: within 0.3 m, 2 % of their distance and 10 deg."""
        tolerance = _TOLERANCE_METRES + _TOLERANCE_OF_DISTANCE * self.distance_m
        return self.translation_m <= tolerance and self.rotation_deg <= _TOLERANCE_DEGREES


@dataclass(frozen=True)
class Revisit:
    """Time during which the camera is at places where it has been before.

    Attributes
    ----------
    begin, end
        First and last time stamp [s].
    """

    begin: float
    end: float

    def seconds_from(self, timestamp: float) -> float:
        """How long before or after it a time stamp is; 0 within."""
        return max(self.begin - timestamp, timestamp - self.end, 0.0)


def loop_error(
    S_cm: FloatArray, true_T_wc: FloatArray, true_T_wm: FloatArray, *, metres_per_unit: float = 1.0
) -> LoopError:
    """Compare what a loop says with the truth.

    Parameters
    ----------
    S_cm
        The loop: similarity (4, 4) from the matched to the present camera. Its scale is what drift
        has made of the unit of length between the two, so its translation is divided by it.
    true_T_wc, true_T_wm
        True poses of the present and of the matched camera, camera to world (4, 4) [m].
    metres_per_unit
        Of the map around the matched keyframe, see `metres_per_unit_at`; 1 unless there is only one
        camera.
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
    """Take the scale of a map of one camera where the camera was at a time.

    Parameters
    ----------
    timestamp
        The time [s].
    estimate
        Lost poses are left out.
    truth
        True poses of the same camera in any world [m].
    reach
        Poses up to so far along the true path before and after are taken [m].
    max_difference
        Poses belong together if their time stamps differ by less [s].

    Raises
    ------
    DatasetError
        If no time stamps match, or fewer than three poses are within reach.
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
    """Find when the camera is where it has been, and looks the same way.

    Parameters
    ----------
    truth
        True poses, camera to world with z ahead [m].
    near
        Distance that still is the same place [m].
    apart
        Metres of path that must lie between the two visits; gaps shorter than it do not end one.
    degrees
        Angle between the two views that still is the same direction [deg].
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
    """Tell for every revisit whether one of the true loops belongs to it.

    A loop may close a little before or after, since the same places are seen from further away: it
    belongs to the revisit nearest in time.

    Parameters
    ----------
    revisits
        From `find_revisits`.
    timestamps
        Of the present cameras of the true loops, (l,) [s].

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
