# SPDX-License-Identifier: BSD-3-Clause
"""A map that is known by its changes only, and the comparison with the map itself."""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.maps import MapChanges


class MapMirror:
    """Applies changes as their documentation says."""

    def __init__(self) -> None:
        self.keyframes: dict[int, tuple[FloatArray, float, int]] = {}
        self.points: dict[int, tuple[FloatArray, int]] = {}
        self.edges: dict[str, IntArray] = {}

    def apply(self, changes: MapChanges) -> None:
        if changes.restarted:
            self.keyframes, self.points, self.edges = {}, {}, {}
        for keyframe in changes.keyframes_removed.tolist():
            del self.keyframes[keyframe]
        for point in changes.points_removed.tolist():
            del self.points[point]
        k, p = changes.keyframes_set, changes.points_set
        for i, keyframe in enumerate(k.ids.tolist()):
            self.keyframes[keyframe] = (k.T_wc[i], float(k.timestamps[i]), int(k.parents[i]))
        for i, point in enumerate(p.ids.tolist()):
            self.points[point] = (p.positions[i], int(p.observation_counts[i]))
        for name in ("covisibility", "loop_edges", "spanning_tree"):
            edges = getattr(changes, name)
            if edges is not None:
                self.edges[name] = edges

    def assert_equals(self, slam_map: core.Map, least_weight: int) -> None:
        """The map has to stand still meanwhile."""
        snapshot = core.snapshot_map(slam_map)
        keyframes, points = snapshot.keyframes, snapshot.points
        known = sorted(self.keyframes)
        assert known == keyframes.ids.tolist()
        for i, keyframe in enumerate(known):
            T_wc, timestamp, parent = self.keyframes[keyframe]
            np.testing.assert_array_equal(T_wc, keyframes.T_wc[i])
            assert (timestamp, parent) == (keyframes.timestamps[i], keyframes.parents[i])
        known = sorted(self.points)
        assert known == points.ids.tolist()
        for i, point in enumerate(known):
            position, count = self.points[point]
            np.testing.assert_array_equal(position, points.positions[i])
            assert count == points.observation_counts[i]
        strong = core.snapshot_edges(slam_map, least_weight)
        expected = {
            "covisibility": np.column_stack([strong.a, strong.b]),
            "loop_edges": snapshot.loop_edges,
            "spanning_tree": np.column_stack([keyframes.ids, keyframes.parents]),
        }
        for name, edges in expected.items():
            published = np.isin(edges, keyframes.ids).all(axis=1)
            np.testing.assert_array_equal(self.edges[name], edges[published], err_msg=name)
