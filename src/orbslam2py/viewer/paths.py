# SPDX-License-Identifier: BSD-3-Clause
"""The camera's trajectory in the world of the map: present, as tracked, and the true one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.evaluation import Similarity, fit_by_time
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.trajectory import Trajectory

#: A path is drawn with at most this number of corners.
MAX_CORNERS = 4000
#: Least number of poses with a true one at their time to align the truth with them.
_MIN_PAIRS = 5
#: Seconds of a path after which the truth is laid beside it anew.
_LAY_EVERY = 1.0
#: What the true path must span along one axis [m]: a camera that stands tells no rotation.
_MIN_SPAN = 1e-3


@dataclass
class OnlinePath:
    """Poses at the time of tracking, without corrections."""

    _map_index: int = -1
    _positions: list[FloatArray] = field(default_factory=list)
    _gaps: list[bool] = field(default_factory=list)
    _after_gap: bool = True

    def add(self, record: TrackingRecord) -> None:
        """Add the pose of an image, if it has one."""
        if record.map_index != self._map_index:
            self._map_index = record.map_index
            self._positions, self._gaps, self._after_gap = [], [], True
        T_wc = record.T_wc
        if T_wc is None:
            self._after_gap = True
            return
        self._positions.append(T_wc[:3, 3])
        self._gaps.append(self._after_gap)
        self._after_gap = False

    def lines(self) -> FloatArray:
        """Return the ends of the segments, (s, 2, 3) world."""
        if not self._positions:
            return np.zeros((0, 2, 3))
        return pieces(np.array(self._positions), np.array(self._gaps))


def pieces(positions: FloatArray, after_gap: np.ndarray | None = None) -> FloatArray:
    """Cut a trajectory into segments between its corners; very long ones have fewer.

    Parameters
    ----------
    positions : array (n, 3)
        Corners, in order.
    after_gap : array of bool (n,), optional
        Corners without a segment before them.

    Returns
    -------
    array (s, 2, 3)
        Ends of the pieces.
    """
    if len(positions) < 2:
        return np.zeros((0, 2, 3))
    gap = np.zeros(len(positions), np.bool_) if after_gap is None else after_gap
    step = -(-len(positions) // MAX_CORNERS)
    kept = np.arange(len(positions)) % step == 0
    kept |= gap | np.append(gap[1:], True)  # both ends of every gap, and the last corner
    corners = positions[kept]
    return np.asarray(np.stack([corners[:-1], corners[1:]], axis=1)[~gap[kept][1:]])


@dataclass(frozen=True)
class LaidTruth:
    """The true trajectory, aligned with the estimate."""

    positions: FloatArray
    """(n, 3) world of the map."""
    error: float
    """RMS distance of the compared poses [m]."""
    similarity: Similarity
    """From the world of the ground truth to that of the map."""


def lay_truth(
    timestamps: FloatArray, positions: FloatArray, truth: Trajectory, *, with_scale: bool
) -> LaidTruth | None:
    """Align the true trajectory with the estimated one.

    Parameters
    ----------
    timestamps : array (n,)
        Seconds of the estimate.
    positions : array (n, 3)
        The estimate, in the world of the map, without lost poses.
    truth : Trajectory
        Ground truth, in its own world.
    with_scale : bool
        Whether to estimate the scale: the map of a single camera has its own unit.

    Returns
    -------
    LaidTruth or None
        None if too few poses have a true one.
    """
    fit = fit_by_time(
        truth.timestamps,
        truth.positions,
        timestamps,
        positions,
        with_scale=with_scale,
        fewest=_MIN_PAIRS,
    )
    if fit is None or np.ptp(truth.positions[fit.rows], axis=0).max() < _MIN_SPAN:
        return None
    laid = fit.similarity.apply(truth.positions)
    off = laid[fit.rows] - positions[fit.other_rows]
    error = float(np.sqrt(np.mean(np.sum(off**2, axis=1)))) / fit.similarity.scale
    return LaidTruth(laid, error, fit.similarity)


class TruthBeside:
    """The true trajectory up to the present time, aligned every second.

    Parameters
    ----------
    truth : Trajectory
        Ground truth, in its own world.
    with_scale : bool
        Whether to estimate the scale: the map of a single camera has its own unit.
    """

    def __init__(self, truth: Trajectory, *, with_scale: bool) -> None:
        self._truth, self._with_scale = truth, with_scale
        self._similarity: Similarity | None = None
        self._map_index = -1
        self._laid_at = -math.inf

    def until(
        self,
        now: float,
        map_index: int,
        path: Callable[[], tuple[FloatArray, FloatArray]],
    ) -> FloatArray:
        """Return true positions (n, 3) until a time, in the world of the map.

        Parameters
        ----------
        now : float
            Seconds.
        map_index : int
            Number of the map; an alignment with another one is invalid.
        path : callable
            Returns the trajectory in the map: time stamps (n,), positions (n, 3), without lost
            poses.
        """
        if map_index != self._map_index:
            self._map_index, self._similarity, self._laid_at = map_index, None, -math.inf
        if self._similarity is None or now >= self._laid_at + _LAY_EVERY:
            laid = lay_truth(*path(), self._truth, with_scale=self._with_scale)
            if laid is not None:
                self._similarity, self._laid_at = laid.similarity, now
        if self._similarity is None:
            return np.zeros((0, 3))
        return self._similarity.apply(self._truth.positions[self._truth.timestamps <= now])
