# SPDX-License-Identifier: BSD-3-Clause
"""What users see of the map: copies, taken while the system may be running."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class MapSnapshot:
    """A consistent copy of a map, in the frame of its first keyframe's first pose (the world).

    Two snapshots are equal if all their arrays are, bit by bit.
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

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MapSnapshot):
            return NotImplemented
        return all(
            np.array_equal(getattr(self, field.name), getattr(other, field.name))
            for field in fields(self)
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
        Which; the active one if None.
    """
    snapshot = core.snapshot_map(slam_map, -1 if map_index is None else map_index)
    keyframes, points = snapshot.keyframes, snapshot.points
    return MapSnapshot(
        keyframe_ids=keyframes.ids,
        keyframe_timestamps=keyframes.timestamps,
        keyframe_T_wc=keyframes.T_wc,
        point_ids=points.ids,
        point_positions=points.positions,
        loop_edges=snapshot.loop_edges,
    )


def keyframe_trajectory(slam_map: core.Map, map_index: int | None = None) -> Trajectory:
    """Poses of the keyframes of a map (None: the active one), relative to the first one."""
    keyframes = core.snapshot_keyframes(slam_map, -1 if map_index is None else map_index)
    T_wc = keyframes.T_wc
    if len(T_wc):
        T_wc = np.linalg.inv(T_wc[0]) @ T_wc
    return Trajectory(timestamps=keyframes.timestamps, T_wc=T_wc)
