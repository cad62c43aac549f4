# SPDX-License-Identifier: BSD-3-Clause
"""Maps for watchers: always in a world with y down, also if an IMU has turned them upright."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.maps.changes import KeyframesSet, MapChanges, MapFollower, PointsSet
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.trajectory.level import T_LEVEL, moved
from orbslam2py.trajectory.rotations import inverse_poses

_Items = TypeVar("_Items", KeyframesSet, PointsSet)

_T_BACK = inverse_poses(T_LEVEL)


class LevelMapFollower:
    """Returns the changes of a map like `MapFollower`, in a world with the axes of a camera.

    The world of a map that an IMU has turned upright has z up; it is turned to x right, y down, z
    forward of a level camera. When a map becomes upright, the changes hold all of it.

    Parameters
    ----------
    slam_map
        The map or maps; other threads may change it.
    map_index
        Number of the map; None: the active one at each query.
    """

    def __init__(self, slam_map: core.Map, *, map_index: int | None = None) -> None:
        self._map, self._index = slam_map, map_index
        self._follower = MapFollower(slam_map, map_index=map_index)
        self._is_upright = False

    def update(self) -> MapChanges:
        """Return the changes since the last call; everything in the first call."""
        changes = self._follower.update()
        # Asked afterwards: a map is turned first, then called upright.
        is_upright = bool(self._map.is_upright(changes.map_index))
        if is_upright != self._is_upright and not changes.restarted:
            changes = self._everything(changes)
        self._is_upright = is_upright
        return _turned(changes) if is_upright else changes

    def _everything(self, changes: MapChanges) -> MapChanges:
        """Return changes that hold the whole map."""
        fresh = MapFollower(self._map, map_index=self._index)
        everything = fresh.update()
        if everything.map_index != changes.map_index:
            self._follower = fresh
            return everything
        later, self._follower = self._follower.update(), fresh
        keyframes = np.union1d(changes.keyframes_removed, later.keyframes_removed)
        points = np.union1d(changes.points_removed, later.points_removed)
        return replace(
            everything,
            restarted=later.restarted,
            keyframes_set=_without(everything.keyframes_set, keyframes),
            keyframes_removed=keyframes,
            points_set=_without(everything.points_set, points),
            points_removed=points,
        )


def turned_record(record: TrackingRecord, slam_map: core.Map) -> TrackingRecord:
    """Return a record with its pose in the world of `LevelMapFollower`.

    Parameters
    ----------
    record
        Of the last image.
    slam_map
        The map or maps.
    """
    if record.T_cw is None or not slam_map.is_upright(record.map_index):
        return record
    return replace(record, T_cw=record.T_cw @ _T_BACK)


def level_positions(positions: FloatArray, slam_map: core.Map) -> FloatArray:
    """Turn positions (n, 3) in the world of the active map in the same way."""
    is_upright = slam_map.is_upright(slam_map.active_map)
    return moved(T_LEVEL, positions) if is_upright else positions


def _turned(changes: MapChanges) -> MapChanges:
    keyframes, points = changes.keyframes_set, changes.points_set
    return replace(
        changes,
        keyframes_set=replace(keyframes, T_wc=T_LEVEL @ keyframes.T_wc),
        points_set=replace(points, positions=moved(T_LEVEL, points.positions)),
    )


def _without(items: _Items, removed: IntArray) -> _Items:
    kept = ~np.isin(items.ids, removed)
    return replace(items, **{one.name: getattr(items, one.name)[kept] for one in fields(items)})
