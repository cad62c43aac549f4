# SPDX-License-Identifier: BSD-3-Clause
"""Pose graphs, read after the definition of g2o's types."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from orbslam2py._arrays import FloatArray
from orbslam2py.maps import export_g2o
from support.made_up_map import made_up_map


@dataclass
class Graph:
    vertices: dict[int, FloatArray] = field(default_factory=dict)
    edges: dict[tuple[int, int], FloatArray] = field(default_factory=dict)
    information: list[FloatArray] = field(default_factory=list)
    fixed: list[int] = field(default_factory=list)
    comments: str = ""


def pose(numbers: list[float]) -> FloatArray:
    T = np.eye(4)
    T[:3, 3] = numbers[:3]
    T[:3, :3] = Rotation.from_quat(numbers[3:]).as_matrix()
    return T


def read_g2o(path: Path) -> Graph:
    graph = Graph()
    for line in path.read_text().splitlines():
        words = line.split()
        if words[0] == "#":
            graph.comments += line
        elif words[0] == "VERTEX_SE3:QUAT":
            assert len(words) == 9
            graph.vertices[int(words[1])] = pose([float(word) for word in words[2:]])
        elif words[0] == "EDGE_SE3:QUAT":
            assert len(words) == 3 + 7 + 21
            ends = int(words[1]), int(words[2])
            assert ends not in graph.edges
            graph.edges[ends] = pose([float(word) for word in words[3:10]])
            upper = np.zeros((6, 6))
            upper[np.triu_indices(6)] = [float(word) for word in words[10:]]
            graph.information.append(upper)
        else:
            assert words[0] == "FIX"
            graph.fixed += [int(word) for word in words[1:]]
    return graph


def test_vertices_and_edges(tmp_path: Path) -> None:
    contents = made_up_map(10, depth=True)
    export_g2o(contents, tmp_path / "map.g2o", least_weight=80)
    graph = read_g2o(tmp_path / "map.g2o")
    keyframes, shared = contents.keyframes, contents.covisibility
    assert list(graph.vertices) == keyframes.ids.tolist()
    np.testing.assert_allclose(list(graph.vertices.values()), keyframes.T_wc, atol=1e-12)
    assert graph.fixed == [0]
    tree = {(min(p, k), max(p, k)) for k, p in enumerate(keyframes.parent.tolist()) if p >= 0}
    strong = shared.weight >= 80
    assert 0 < strong.sum() < len(shared)
    strong_pairs = set(zip(shared.a[strong].tolist(), shared.b[strong].tolist(), strict=True))
    assert set(graph.edges) == tree | strong_pairs | {(0, 9)}
    for (a, b), T_ab in graph.edges.items():
        expected = np.linalg.inv(graph.vertices[a]) @ graph.vertices[b]
        np.testing.assert_allclose(T_ab, expected, atol=1e-9)
    for information in graph.information:
        np.testing.assert_array_equal(information, np.eye(6))
    assert "metres" in graph.comments


def test_a_single_camera_is_told_about_its_scale(tmp_path: Path) -> None:
    export_g2o(made_up_map(4), tmp_path / "map.g2o")
    graph = read_g2o(tmp_path / "map.g2o")
    assert "units" in graph.comments
    assert "SIM3" in graph.comments
    # Nothing shares 100 points here: the tree is left, and the loop.
    assert len(graph.edges) == 4


def test_the_graph_hangs_together(tmp_path: Path) -> None:
    contents = made_up_map(12, seed=5, loop=False)
    export_g2o(contents, tmp_path / "map.g2o", least_weight=10_000)
    graph = read_g2o(tmp_path / "map.g2o")
    reached = {0}
    for _ in graph.vertices:
        reached |= {end for edge in graph.edges if reached & set(edge) for end in edge}
    assert reached == set(graph.vertices)
    assert len(graph.edges) == len(graph.vertices) - 1
