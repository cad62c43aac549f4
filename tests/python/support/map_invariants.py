# SPDX-License-Identifier: BSD-3-Clause
"""What holds for the contents of every map: docs/method/map.md#invariants, on arrays."""

from __future__ import annotations

import numpy as np

from orbslam2py.maps import MapContents


def check_invariants(contents: MapContents) -> None:
    """Assert that the contents are those of a map."""
    keyframes, points, seen = contents.keyframes, contents.points, contents.observations
    assert len(keyframes)
    for ids, following in (
        (keyframes.ids, contents.next_keyframe),
        (points.ids, contents.next_point),
        (contents.removed_keyframes.ids, contents.next_keyframe),
    ):
        assert np.all(np.diff(ids) > 0)
        assert not len(ids) or (ids[0] >= 0 and ids[-1] < following)
    _check_keyframes(contents)
    # Observations: of what is there, in order, each keypoint used once.
    assert np.isin(seen.point, points.ids).all()
    assert np.isin(seen.keyframe, keyframes.ids).all()
    order = np.lexsort((seen.keyframe, seen.point))
    np.testing.assert_array_equal(order, np.arange(len(seen)))
    assert len(np.unique(np.column_stack([seen.point, seen.keyframe]), axis=0)) == len(seen)
    rows = contents.observed_keypoints
    assert len(np.unique(rows)) == len(rows)
    ends = keyframes.offsets[np.searchsorted(keyframes.ids, seen.keyframe) + 1]
    assert np.all((seen.keypoint >= 0) & (rows < ends))
    # Points: seen, also by their reference keyframe.
    np.testing.assert_array_equal(np.unique(seen.point), points.ids)
    pairs = set(zip(seen.point.tolist(), seen.keyframe.tolist(), strict=True))
    referred = zip(points.ids.tolist(), points.reference_keyframe.tolist(), strict=True)
    assert pairs.issuperset(referred)
    assert np.all((points.min_distance >= 0) & (points.max_distance >= points.min_distance))
    # Edges.
    edges = contents.covisibility
    assert np.all(edges.weight >= 1)
    for ends_of_edges in (np.column_stack([edges.a, edges.b]), contents.loop_edges):
        assert np.isin(ends_of_edges, keyframes.ids).all()
        assert np.all(ends_of_edges[:, 0] < ends_of_edges[:, 1])
        assert len(np.unique(ends_of_edges, axis=0)) == len(ends_of_edges)


def _check_keyframes(contents: MapContents) -> None:
    keyframes = contents.keyframes
    n = int(keyframes.offsets[-1])
    for name, array in keyframes.arrays():
        if name == "offsets":
            assert len(array) == len(keyframes) + 1
        elif len(array) != len(keyframes):
            assert len(array) == n or (
                name in ("raw_keypoints", "colours", "words") and not len(array)
            )
    # The tree spans them all: everybody reaches keyframe 0, which has no parent.
    assert keyframes.ids[0] == 0
    assert keyframes.parent[0] == -1
    parent = dict(zip(keyframes.ids.tolist(), keyframes.parent.tolist(), strict=True))
    for start in parent:
        way = start
        for _ in parent:
            way = parent[way] if way else 0
        assert way == 0, f"keyframe {start} is not in the tree"
    removed = contents.removed_keyframes
    assert not np.isin(removed.ids, keyframes.ids).any()
    hangs = {**parent, **dict(zip(removed.ids.tolist(), removed.parent.tolist(), strict=True))}
    for start in removed.ids.tolist():
        way = start
        for _ in removed.ids:
            way = way if way in parent else hangs[way]
        assert way in parent
