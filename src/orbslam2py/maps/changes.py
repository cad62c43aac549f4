# SPDX-License-Identifier: BSD-3-Clause
"""Changes of a growing map since the last query: for viewers and recorders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray

#: Shared points of an edge that is worth drawing, as in the essential graph (ORB-SLAM, III-D).
STRONG_EDGE = 100


@dataclass(frozen=True, eq=False)
class KeyframesSet:
    """New or changed keyframes, in their present state."""

    ids: IntArray
    """(k,) ascending."""
    T_wc: FloatArray
    """(k, 4, 4) camera to world."""
    timestamps: FloatArray
    """(k,) seconds."""
    parents: IntArray
    """(k,) parent in the spanning tree, -1 for the first keyframe of the map."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class PointsSet:
    """New or changed points, in their present state."""

    ids: IntArray
    """(p,) ascending."""
    positions: FloatArray
    """(p, 3) world [m] (one camera: the map's own units)."""
    observation_counts: IntArray
    """(p,) sum over the observing keyframes: 2 with depth, 1 without."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False, repr=False)
class MapChanges:
    """The changes from the map at the last query to the map at one later moment.

    Apply them in order: drop everything if `restarted`, drop the removed items, then store the
    given ones. The result is the published keyframes and all points of that moment. The given items
    may include unchanged ones.
    """

    map_index: int
    """Number of the map, as in `TrackingRecord.map_index`."""
    restarted: bool
    """Earlier copies are invalid: this is the first query, or the map is another one."""
    keyframes_set: KeyframesSet
    """New, moved or otherwise changed keyframes."""
    keyframes_removed: IntArray
    """(r,) ids, ascending, of removed keyframes that earlier queries gave."""
    points_set: PointsSet
    """New, moved or otherwise changed points."""
    points_removed: IntArray
    """(q,) ids, ascending, of removed points that earlier queries gave."""
    covisibility: IntArray | None
    """(e, 2) all pairs of keyframes that share many points, the lower id first; None if
    unchanged."""
    loop_edges: IntArray | None
    """(l, 2) all pairs of keyframes that a closed loop connects, the lower id first; None if
    unchanged."""
    spanning_tree: IntArray | None
    """(t, 2) all pairs of a keyframe and its parent, in this order; None if unchanged."""

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
        edges = [
            name.replace("_", " ")
            for name in ("covisibility", "loop_edges", "spanning_tree")
            if getattr(self, name) is not None
        ]
        return (
            f"<MapChanges: map {self.map_index}{' from the beginning' if self.restarted else ''}, "
            f"keyframes +{len(self.keyframes_set)} -{len(self.keyframes_removed)}, "
            f"points +{len(self.points_set)} -{len(self.points_removed)}"
            f"{', new ' + ', '.join(edges) if edges else ''}>"
        )


class MapFollower:
    """Returns the changes of a map since the last query.

    The cost of a query depends on the changes, not on the size of the map: maps of thousands of
    keyframes can be queried several times a second. A query gives the state of one moment, does not
    block tracking, and may come from any thread.

    Parameters
    ----------
    slam_map
        The map, as in ``slam.pipeline.back_end.map``; other threads may change it.
    least_weight
        Least number of shared points of two keyframes whose covisibility is reported.
    map_index
        Number of the map, if there are several; None: the active one at each query.
    """

    def __init__(
        self,
        slam_map: core.Map,
        *,
        least_weight: int = STRONG_EDGE,
        map_index: int | None = None,
    ) -> None:
        which = -1 if map_index is None else map_index
        self._follower = core.MapFollower(slam_map, least_weight, which)

    def update(self) -> MapChanges:
        """Look at the map.

        Returns
        -------
        MapChanges
            The changes since the last call; everything in the first call.
        """
        changes = self._follower.update()
        keyframes, points = changes.keyframes_set, changes.points_set
        return MapChanges(
            map_index=int(changes.map),
            restarted=changes.restarted,
            keyframes_set=KeyframesSet(
                keyframes.ids, keyframes.T_wc, keyframes.timestamps, keyframes.parents
            ),
            keyframes_removed=changes.keyframes_removed,
            points_set=PointsSet(
                points.ids, points.positions, points.observation_counts.astype(np.int64)
            ),
            points_removed=changes.points_removed,
            covisibility=changes.covisibility,
            loop_edges=changes.loop_edges,
            spanning_tree=changes.spanning_tree,
        )
