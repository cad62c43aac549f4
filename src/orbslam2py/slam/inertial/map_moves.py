# SPDX-License-Identifier: BSD-3-Clause
"""Motions of a whole map by an IMU, and their effect on earlier poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.records import TrackingRecord


@dataclass(frozen=True)
class MapMove:
    """An IMU turned a map upright, or gave it another scale."""

    map_index: int
    """Number of the map."""
    until: float
    """Seconds of the last image with a pose in the world before."""
    scale: float
    """Factor on lengths."""
    turn: core.Pose
    """From the world before to the new one, after the scale."""

    def apply(self, record: TrackingRecord) -> TrackingRecord:
        """Return a record with its pose, covariance and velocity in the new world."""
        is_earlier = record.map_index == self.map_index and record.timestamp <= self.until
        if not is_earlier or record.T_cw is None:
            return record
        T_cw = record.T_cw.copy()
        T_cw[:3, 3] *= self.scale
        lengths = np.repeat([1.0, self.scale], 3)
        covariance, inertial = record.covariance, record.inertial
        if covariance is not None:
            covariance = covariance * np.outer(lengths, lengths)
        if inertial is not None:
            velocity = self.scale * self.turn.rotation_matrix @ inertial.velocity
            inertial = replace(inertial, velocity=velocity)
        return replace(
            record,
            T_cw=T_cw @ self.turn.inverse().matrix,
            covariance=covariance,
            inertial=inertial,
        )


def in_last_world(record: TrackingRecord, moves: Sequence[MapMove]) -> TrackingRecord:
    """Return a record with its pose in the last world of its map.

    Corrections of the map itself, such as loops, are not part of it.

    Parameters
    ----------
    record
        As it was after its image.
    moves
        All moves, the first one first.
    """
    for move in moves:
        record = move.apply(record)
    return record
