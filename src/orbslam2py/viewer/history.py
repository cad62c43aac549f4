# SPDX-License-Identifier: BSD-3-Clause
"""The map of a finished run up to a time."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.maps.changes import KeyframesSet, MapChanges, PointsSet
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.viewer.map_model import MapModel


def changes_until(arrays: MapArrays, model: MapModel, now: float) -> MapChanges:
    """Return the changes from the shown map to the final one, as far as seen until a time."""
    there = arrays.keyframe_timestamps <= now + 1e-6
    ids = arrays.keyframe_ids[there]
    new = np.flatnonzero(there & ~np.isin(arrays.keyframe_ids, model.keyframe_ids))
    shown_points = np.concatenate(
        [np.zeros(0, np.int64), *(part.ids for part in model.points.values())]
    )
    seen = np.isin(arrays.point_first_keyframes, ids)
    new_points = np.flatnonzero(seen & ~np.isin(arrays.point_ids, shown_points))
    tree = arrays.spanning_tree
    parents = dict(tree.tolist())
    return MapChanges(
        map_index=0,
        restarted=False,
        keyframes_set=KeyframesSet(
            arrays.keyframe_ids[new],
            arrays.keyframe_T_wc[new],
            arrays.keyframe_timestamps[new],
            np.array([parents.get(i, -1) for i in arrays.keyframe_ids[new].tolist()], np.int64),
        ),
        keyframes_removed=np.setdiff1d(model.keyframe_ids, ids),
        points_set=PointsSet(
            arrays.point_ids[new_points],
            arrays.point_positions[new_points],
            arrays.point_observations[new_points],
        ),
        points_removed=np.setdiff1d(shown_points, arrays.point_ids[seen]),
        covisibility=_between(arrays.covisibility, ids),
        loop_edges=_between(arrays.loop_edges, ids),
        spanning_tree=_between(tree, ids),
    )


def _between(pairs: IntArray, ids: IntArray) -> IntArray:
    found: IntArray = pairs[np.isin(pairs, ids).all(axis=1)]
    return found
