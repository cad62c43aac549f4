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
    """(k,) parent in the spanning tree, -1 for the first keyframe of the map."""

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


@dataclass(frozen=True, eq=False, repr=False)
class MapChanges:
    """What turns the map as it was at the last look into the map of one later moment.

    Who applies them in order (forget everything if `restarted`, then drop what was removed, then
    take over what is set) has the published keyframes and all points of that moment. What is set
    may also be as it was before.
    """

    map_index: int
    """Which map it is, as in `TrackingRecord.map_index`."""
    restarted: bool
    """Everything seen before is void: the first look, or another map than before."""
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
    """Tells at every look what has changed in a map since the look before.

    A look costs what has changed, not what there is: a map of thousands of keyframes can be
    followed several times a second. It is of one moment, does not keep tracking waiting, and may
    be taken from any thread.

    Parameters
    ----------
    slam_map
        The map, as in ``slam.pipeline.back_end.map``; other threads may change it.
    least_weight
        Least number of shared points of two keyframes whose covisibility is reported.
    map_index
        The map that is followed, if there are several; None: the active one, whichever that is.
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
            What has changed since the last call; in the first, everything.
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
