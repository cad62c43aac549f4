# SPDX-License-Identifier: BSD-3-Clause
"""Copies of the map for users, made while the system may be running."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class MapSnapshot:
    """A consistent copy of a map, in the frame of its first keyframe's first pose (the world).

    Of a map that an IMU has turned upright, the world has z up.

    Each of several maps has a separate world: the relative pose of two maps is not known. Two
    snapshots are equal if all their arrays are, bit by bit.
    """

    keyframe_ids: IntArray
    """(k,) ascending."""
    keyframe_timestamps: FloatArray
    """(k,) seconds."""
    keyframe_T_wc: FloatArray
    """(k, 4, 4) camera to world, lengths as in `point_positions`."""
    point_ids: IntArray
    """(p,) ascending."""
    point_positions: FloatArray
    """(p, 3) world [m] (one camera: the map's own units)."""
    loop_edges: IntArray
    """(l, 2) ids of the keyframes that a closed loop connects."""
    map_index: int = field(default=0, compare=False)
    """Number of its map, as in `TrackingRecord.map_index`; not compared."""
    is_upright: bool = field(default=False, compare=False)
    """Whether an IMU has turned the map upright; not compared."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MapSnapshot):
            return NotImplemented
        return all(
            np.array_equal(getattr(self, one.name), getattr(other, one.name))
            for one in fields(self)
            if one.compare
        )

    __hash__ = None  # type: ignore[assignment]  # arrays may be changed

    def __repr__(self) -> str:
        return (
            f"<MapSnapshot: keyframes {len(self.keyframe_ids)}, points {len(self.point_ids)}, "
            f"loop edges {len(self.loop_edges)}>"
        )


def take_snapshot(slam_map: core.Map, map_index: int | None = None) -> MapSnapshot:
    """Copy keyframe poses, points and loop edges of a map in one consistent view.

    Parameters
    ----------
    slam_map
        The map or maps.
    map_index
        Number of the map; None: the active one.
    """
    chosen = int(slam_map.active_map) if map_index is None else map_index
    snapshot = core.snapshot_map(slam_map, chosen)
    while map_index is None and slam_map.active_map != chosen:  # it was merged, or is inactive now
        chosen = int(slam_map.active_map)
        snapshot = core.snapshot_map(slam_map, chosen)
    keyframes, points = snapshot.keyframes, snapshot.points
    return MapSnapshot(
        keyframe_ids=keyframes.ids,
        keyframe_timestamps=keyframes.timestamps,
        keyframe_T_wc=keyframes.T_wc,
        point_ids=points.ids,
        point_positions=points.positions,
        loop_edges=snapshot.loop_edges,
        map_index=chosen,
        is_upright=bool(slam_map.is_upright(chosen)),
    )


def take_snapshots(slam_map: core.Map) -> list[MapSnapshot]:
    """Copy all maps, the oldest first; no keyframe or point belongs to two of them.

    Parameters
    ----------
    slam_map
        The map or maps.
    """
    while True:
        epoch, there = slam_map.epoch, slam_map.maps
        snapshots = [take_snapshot(slam_map, index) for index in there]
        # Two maps that were merged in between would be listed twice, in two worlds.
        if (slam_map.epoch, slam_map.maps) == (epoch, there):
            return snapshots


def keyframe_trajectory(slam_map: core.Map, map_index: int | None = None) -> Trajectory:
    """Poses of the keyframes of a map (None: the active one), in the world of its trajectory.

    They are relative to the first keyframe; an upright map keeps its own world.
    In the order of time; the order of ids may differ at the start of a single camera's map.
    """
    keyframes = core.snapshot_keyframes(slam_map, -1 if map_index is None else map_index)
    T_wc = keyframes.T_wc
    if len(T_wc):
        which = slam_map.active_map if map_index is None else map_index
        T_wc = T_wc if slam_map.is_upright(which) else np.linalg.inv(T_wc[0]) @ T_wc
    order = np.argsort(keyframes.timestamps, kind="stable")
    return Trajectory(timestamps=keyframes.timestamps[order], T_wc=T_wc[order])
