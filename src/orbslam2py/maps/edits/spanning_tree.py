# SPDX-License-Identifier: BSD-3-Clause
"""What connects the keyframes of a map that has lost some: shared points, and a tree."""

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


def spanning_parents(
    keyframes: Keyframes, covisibility: Covisibility
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Make a spanning tree of what is left of one.

    A keyframe keeps its parent if that is there. Otherwise it hangs on its strongest neighbour that
    is not in its own subtree (of equals, the lower id), and without one provisionally on the
    keyframe before it (``docs/method/map.md#spanning-tree``).

    Parameters
    ----------
    keyframes
        Those that are there, by ascending id; the first becomes the root. Parents may be missing.
    covisibility
        Of these keyframes.

    Returns
    -------
    parents, provisional
        Ids int64 (k,), -1 for the root; and bool (k,).
    """
    ids = keyframes.ids
    place = np.searchsorted(ids, keyframes.parent)
    there = (keyframes.parent >= 0) & (ids[np.minimum(place, len(ids) - 1)] == keyframes.parent)
    parents = np.where(there, place, _NONE)
    parents[0] = _NONE
    provisional = keyframes.provisional_parent & there
    provisional[0] = False
    neighbours = _neighbours(ids, covisibility)
    for child in range(1, len(ids)):
        if parents[child] == _NONE:
            near = [n for n in neighbours[child] if not _is_above(parents, child, n)]
            # The root has no parent, so it is in nobody's subtree: the search always ends.
            before = (n for n in range(child - 1, -1, -1) if not _is_above(parents, child, n))
            parents[child] = near[0] if near else next(before)
            provisional[child] = not near
    return np.where(parents == _NONE, _NONE, ids[parents]), provisional


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
