# SPDX-License-Identifier: BSD-3-Clause
"""What has changed in a growing map since the last look: for viewers and recorders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray

#: Shared points of an edge that is worth drawing, as in the essential graph (ORB-SLAM, III-D).
STRONG_EDGE = 100


@dataclass(frozen=True, eq=False)
class KeyframesSet:
    """Keyframes that are new or have changed, as they are now."""

    ids: IntArray
    """(k,) ascending."""
    T_wc: FloatArray
    """(k, 4, 4) camera to world."""
    timestamps: FloatArray
    """(k,) seconds."""
    parents: IntArray
    """(k,) parent in the spanning tree, -1 for keyframe 0."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class PointsSet:
    """Points that are new or have changed, as they are now."""

    ids: IntArray
    """(p,) ascending."""
    positions: FloatArray
    """(p, 3) world [m] (one camera: the map's own units)."""
    observation_counts: IntArray
    """(p,) 2 per keyframe that sees the point with depth, 1 per keyframe without."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class MapChanges:
    """What turns the map as it was at the last look into the map of one later moment.

    Who applies them in order (forget everything if `restarted`, then drop what was removed, then
    take over what is set) has the published keyframes and all points of that moment. What is set
    may also be as it was before.
    """

    map_index: int
    """Which map it is, as in `TrackingRecord.map_index`."""
    restarted: bool
    """Everything seen before is void: the first look, or another map has begun, whose ids begin
    anew."""
    keyframes_set: KeyframesSet
    """New, moved or otherwise changed keyframes."""
    keyframes_removed: IntArray
    """(r,) ids, ascending, of keyframes that were given before."""
    points_set: PointsSet
    """New, moved or otherwise changed points."""
    points_removed: IntArray
    """(q,) ids, ascending, of points that were given before."""
    covisibility: IntArray | None
    """(e, 2) all pairs of keyframes that share many points, the lower id first; None if the pairs
    are as before."""
    loop_edges: IntArray | None
    """(l, 2) all pairs of keyframes that a closed loop connects, the lower id first; None if they
    are as before."""
    spanning_tree: IntArray | None
    """(t, 2) all pairs of a keyframe and its parent, in this order; None if they are as before."""

    def __bool__(self) -> bool:
        """Whether anything has changed."""
        n_objects = (
            len(self.keyframes_set)
            + len(self.keyframes_removed)
            + len(self.points_set)
            + len(self.points_removed)
        )
        edges = (self.covisibility, self.loop_edges, self.spanning_tree)
        return self.restarted or n_objects > 0 or any(pairs is not None for pairs in edges)

    def __repr__(self) -> str:
        new_edges = [
            name
            for name in ("covisibility", "loop_edges", "spanning_tree")
            if getattr(self, name) is not None
        ]
        return (
            f"MapChanges(map_index={self.map_index}, restarted={self.restarted}, "
            f"keyframes=+{len(self.keyframes_set)} -{len(self.keyframes_removed)}, "
            f"points=+{len(self.points_set)} -{len(self.points_removed)}, "
            f"edges={', '.join(new_edges) or 'as before'})"
        )


class MapFollower:
    """Tells at every look what has changed in a map since the look before.

    Parameters
    ----------
    slam_map
        The map; another thread may change it.
    least_weight
        Shared points of two keyframes whose covisibility is told.
    """

    def __init__(self, slam_map: core.Map, *, least_weight: int = STRONG_EDGE) -> None:
        self._map = slam_map
        self._least_weight = least_weight
        self._seen: _Look | None = None

    def update(self) -> MapChanges:
        """Look at the map.

        Returns
        -------
        MapChanges
            What has changed since the last call; in the first, everything.
        """
        look = _Look(self._map, self._least_weight)
        restarted = self._seen is None or self._seen.map_index != look.map_index
        before = _Look(core.Map(), 1) if self._seen is None or restarted else self._seen
        self._seen = look
        k = _changed(before.keyframe_rows, look.keyframe_rows)
        p = _changed(before.point_rows, look.point_rows)
        keyframes, points = look.keyframes, look.points
        covisibility, loop_edges, spanning_tree = (
            now if restarted or not np.array_equal(now, then) else None
            for now, then in zip(look.edges, before.edges, strict=True)
        )
        return MapChanges(
            map_index=look.map_index,
            restarted=restarted,
            keyframes_set=KeyframesSet(
                keyframes.ids[k], keyframes.T_wc[k], keyframes.timestamps[k], keyframes.parents[k]
            ),
            keyframes_removed=np.setdiff1d(before.keyframes.ids, keyframes.ids),
            points_set=PointsSet(
                points.ids[p],
                points.positions[p],
                points.observation_counts[p].astype(np.int64),
            ),
            points_removed=np.setdiff1d(before.points.ids, points.ids),
            covisibility=covisibility,
            loop_edges=loop_edges,
            spanning_tree=spanning_tree,
        )


class _Look:
    """The whole map at one moment."""

    def __init__(self, slam_map: core.Map, least_weight: int) -> None:
        self.map_index = int(slam_map.epoch)
        snapshot = core.snapshot_map(slam_map)
        strong = core.snapshot_edges(slam_map, least_weight)
        self.keyframes, self.points = snapshot.keyframes, snapshot.points
        ids, parents = self.keyframes.ids, self.keyframes.parents
        tree = np.column_stack([ids, parents])[parents >= 0]
        self.edges = (np.column_stack([strong.a, strong.b]), snapshot.loop_edges, tree)
        self.keyframe_rows = np.column_stack([ids, self.keyframes.T_wc.reshape(-1, 16), parents])
        self.point_rows = np.column_stack(
            [self.points.ids, self.points.positions, self.points.observation_counts]
        )


def _changed(before: FloatArray, now: FloatArray) -> IntArray:
    """Which rows of `now`, whose first column is an ascending id, are not in `before`."""
    _, then, here = np.intersect1d(before[:, 0], now[:, 0], assume_unique=True, return_indices=True)
    same = np.zeros(len(now), dtype=bool)
    same[here] = (before[then] == now[here]).all(axis=1)
    return np.flatnonzero(~same)
