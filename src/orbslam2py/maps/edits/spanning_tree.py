# SPDX-License-Identifier: BSD-3-Clause
"""The graph of a map, also after keyframes were removed: shared points and spanning tree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import IntArray
from orbslam2py.maps.content_groups import Covisibility, Keyframes, Observations

_NONE = -1


def count_covisibility(observations: Observations, keyframe_ids: IntArray) -> Covisibility:
    """Count the points that each pair of keyframes shares.

    Parameters
    ----------
    observations
        By ascending (point, keyframe).
    keyframe_ids
        All keyframes, ascending (k,).

    Returns
    -------
    Covisibility
        Pairs that share at least one point.
    """
    k = len(keyframe_ids)
    rows = np.searchsorted(keyframe_ids, observations.keyframe)
    _, point = np.unique(observations.point, return_inverse=True)
    first = np.concatenate([[0], np.cumsum(np.bincount(point))]).astype(np.int64)
    by_keyframe = np.argsort(rows, kind="stable")
    bounds = np.searchsorted(rows[by_keyframe], np.arange(k + 1))
    pairs, weights = [], []
    for a in range(k):
        mine = point[by_keyframe[bounds[a] : bounds[a + 1]]]
        # All observations of its points, as one array of places.
        lengths = first[mine + 1] - first[mine]
        within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        shared = np.bincount(rows[np.repeat(first[mine], lengths) + within], minlength=k)
        others = a + 1 + np.flatnonzero(shared[a + 1 :])
        pairs.append(np.column_stack([np.full(len(others), a), others]))
        weights.append(shared[others])
    a, b = np.concatenate([np.zeros((0, 2), np.int64), *pairs]).T
    weight = np.concatenate([np.zeros(0, np.int64), *weights]).astype(np.int32)
    return Covisibility(keyframe_ids[a], keyframe_ids[b], weight)


def map_numbers(keyframes: Keyframes) -> IntArray:
    """Number of the map of every keyframe, int64 (k,): 0 for the oldest one in the file."""
    parents = _parent_rows(keyframes)
    above = np.where(parents == _NONE, np.arange(len(parents)), parents)
    while True:
        higher = above[above]
        if np.array_equal(higher, above):
            break
        above = higher
    return np.asarray(np.unique(above, return_inverse=True)[1], np.int64)


def spanning_parents(
    keyframes: Keyframes, covisibility: Covisibility, maps: IntArray
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Make a spanning tree of the remaining keyframes of each map.

    A keyframe keeps its parent if that remains. Otherwise its parent is its strongest neighbour
    outside its own subtree (of equals, the lower id). Without one, it is provisionally the previous
    keyframe of the map (``docs/method/map.md#spanning-tree``).

    Parameters
    ----------
    keyframes
        The remaining keyframes by ascending id; the first of each map becomes its root, if it is
        not. Parents may be missing.
    covisibility
        Of these keyframes.
    maps
        Numbers (k,) of their maps; different maps have no common tree.

    Returns
    -------
    parents, provisional
        Ids of the parents, int64 (k,), -1 for the roots; and whether they are provisional, bool
        (k,).
    """
    ids = keyframes.ids
    parents = _parent_rows(keyframes)
    provisional = keyframes.provisional_parent & (parents != _NONE)
    roots = np.unique(maps, return_index=True)[1]
    parents[roots], provisional[roots] = _NONE, False
    neighbours = _neighbours(ids, covisibility)
    for child in np.setdiff1d(np.flatnonzero(parents == _NONE), roots).tolist():
        mine = maps == maps[child]
        near = [n for n in neighbours[child] if mine[n] and not _is_above(parents, child, n)]
        # The root has no parent, so it is in no other subtree: the search always ends.
        rows = np.flatnonzero(mine[:child])[::-1].tolist()
        before = (n for n in rows if not _is_above(parents, child, n))
        parents[child] = near[0] if near else next(before)
        provisional[child] = not near
    return np.where(parents == _NONE, _NONE, ids[parents]), provisional


def _parent_rows(keyframes: Keyframes) -> IntArray:
    """Row of the parent of each keyframe (k,), -1 if it has none among them."""
    ids, parents = keyframes.ids, keyframes.parent
    place = np.minimum(np.searchsorted(ids, parents), len(ids) - 1)
    return np.where((parents >= 0) & (ids[place] == parents), place, _NONE)


def _neighbours(ids: IntArray, covisibility: Covisibility) -> list[list[int]]:
    """Rows of the keyframes that share points with each, the strongest first."""
    a, b = np.searchsorted(ids, covisibility.a), np.searchsorted(ids, covisibility.b)
    one, other = np.concatenate([a, b]), np.concatenate([b, a])
    weight = np.concatenate([covisibility.weight, covisibility.weight])
    order = np.lexsort((other, -weight, one))
    bounds = np.searchsorted(one[order], np.arange(len(ids) + 1)).tolist()
    sorted_others = other[order].tolist()
    return [sorted_others[bounds[i] : bounds[i + 1]] for i in range(len(ids))]


def _is_above(parents: IntArray, ancestor: int, keyframe: int) -> bool:
    """Whether a keyframe is in the subtree of another."""
    while keyframe not in (_NONE, ancestor):
        keyframe = int(parents[keyframe])
    return keyframe == ancestor
