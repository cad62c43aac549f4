# SPDX-License-Identifier: BSD-3-Clause
"""Closed loops against ground truth: which are true, and which places seen again were missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbslam2py.evaluation.metrics import align, match_poses
from orbslam2py.slam.events import LoopClosed
from orbslam2py.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: How far the truth may be from what a true loop says.
TOLERANCE_METRES = 0.3
TOLERANCE_OF_DISTANCE = 0.02
TOLERANCE_DEGREES = 10.0


@dataclass(frozen=True)
class Judgement:
    """A closed loop and what the truth says about it."""

    timestamp: float
    """Of the present keyframe [s]."""
    distance: float
    """True distance of the two cameras [m]."""
    metres: float
    """How far the truth is from the loop's relative position."""
    degrees: float
    """How far the truth is from the loop's relative orientation."""

    @property
    def is_true(self) -> bool:
        """The cameras are where the loop says."""
        tolerance = TOLERANCE_METRES + TOLERANCE_OF_DISTANCE * self.distance
        return self.metres <= tolerance and self.degrees <= TOLERANCE_DEGREES


@dataclass(frozen=True)
class Revisit:
    """Time during which the camera is at places where it has been before [s]."""

    begin: float
    end: float

    def seconds_from(self, timestamp: float) -> float:
        """How long before or after it a time stamp is; 0 within."""
        return max(self.begin - timestamp, timestamp - self.end, 0.0)


def judge_loop(loop: LoopClosed, truth: Trajectory, metres_per_unit: float = 1.0) -> Judgement:
    """Compare a loop's relative pose with the true one.

    Parameters
    ----------
    loop
        A similarity from the matched to the present camera; its scale is what drift has made of the
        unit of length between the two, so its translation is divided by it.
    truth
        Exact poses at the time stamps of the keyframes.
    metres_per_unit
        Of the map around the matched keyframe; 1 unless there is only one camera.
    """
    T_wc = _pose_at(truth, loop.current_timestamp)
    T_wm = _pose_at(truth, loop.matched_timestamp)
    S_cm = loop.S_cm
    scale = np.cbrt(np.linalg.det(S_cm[:3, :3]))
    # Of the similarity: position and axes of the present camera in the matched one.
    R_mc = S_cm[:3, :3].T / scale
    claimed = -R_mc @ S_cm[:3, 3] / scale * metres_per_unit
    T_mc = np.linalg.inv(T_wm) @ T_wc
    cosine = (np.trace(R_mc.T @ T_mc[:3, :3]) - 1) / 2
    return Judgement(
        timestamp=loop.current_timestamp,
        distance=float(np.linalg.norm(T_mc[:3, 3])),
        metres=float(np.linalg.norm(claimed - T_mc[:3, 3])),
        degrees=float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
    )


def metres_per_unit_at(
    timestamp: float, estimate: Trajectory, truth: Trajectory, metres: float
) -> float:
    """Scale of a map of one camera where the camera was at a time.

    Parameters
    ----------
    metres
        The poses up to so far along the way before and after are taken.
    """
    i, j = match_poses(estimate, truth)
    along = path_lengths(truth)
    there = along[int(np.argmin(np.abs(truth.timestamps - timestamp)))]
    near = np.abs(along[j] - there) <= metres
    return align(estimate.positions[i[near]], truth.positions[j[near]], with_scale=True).scale


def path_lengths(trajectory: Trajectory) -> Array:
    """Metres from the start, (n,)."""
    steps = np.linalg.norm(np.diff(trajectory.positions, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def revisits(
    truth: Trajectory, *, near: float, apart: float, degrees: float = 30.0
) -> list[Revisit]:
    """Find when the camera is where it has been, and looks the same way.

    Parameters
    ----------
    near
        Distance that still is the same place [m].
    apart
        Metres of path that must lie between the two visits; gaps shorter than it do not end one.
    degrees
        Angle between the two views that still is the same direction.
    """
    along = path_lengths(truth)
    ahead = truth.T_wc[:, :3, 2]
    found = np.zeros(len(truth), bool)
    for k in range(len(truth)):
        earlier = along <= along[k] - apart
        distances = np.linalg.norm(truth.positions[earlier] - truth.positions[k], axis=1)
        same_direction = ahead[earlier] @ ahead[k] >= np.cos(np.radians(degrees))
        found[k] = bool(np.any((distances <= near) & same_direction))
    spans: list[list[int]] = []
    for k in np.flatnonzero(found):
        if spans and along[k] - along[spans[-1][1]] < apart:
            spans[-1][1] = int(k)
        else:
            spans.append([int(k), int(k)])
    return [Revisit(float(truth.timestamps[a]), float(truth.timestamps[b])) for a, b in spans]


def closed_revisits(places: Sequence[Revisit], true_loops: Sequence[Judgement]) -> list[bool]:
    """Tell for every revisit whether one of the true loops belongs to it.

    A loop may close a little before or after, since the same places are seen from further away: it
    belongs to the revisit nearest in time.
    """
    closed = [False] * len(places)
    for loop in true_loops:
        if places:
            away = [place.seconds_from(loop.timestamp) for place in places]
            closed[int(np.argmin(away))] = True
    return closed


def _pose_at(truth: Trajectory, timestamp: float) -> Array:
    index = int(np.argmin(np.abs(truth.timestamps - timestamp)))
    T_wc: Array = truth.T_wc[index]
    return T_wc
