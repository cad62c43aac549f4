# SPDX-License-Identifier: BSD-3-Clause
"""The keyframes of a map as a pose graph for g2o, GTSAM and the examples of Ceres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arguments import path_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._files import atomic_write
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.units import sees_metres, unit_of
from orbslam2py.trajectory.rotations import inverse_poses, quaternions_from_rotations

#: Shared points from which on two keyframes are linked: those of the essential graph (ORB-SLAM,
#: section III-D).
ESSENTIAL_WEIGHT = 100

#: Upper triangle of the identity (6, 6), row by row.
_INFORMATION = " ".join("1" if i == j else "0" for i in range(6) for j in range(i, 6))

_OWN_UNIT = "# a single camera: lengths are in the map's own unit\n"
_DRIFT = (
    "# a single camera: the drift of lengths along the way is not in this graph, which has\n"
    "# rotations and translations only (scales: VERTEX_SIM3:QUAT)\n"
)


def export_g2o(
    contents: MapContents, path: str | Path, *, least_weight: int = ESSENTIAL_WEIGHT
) -> None:
    """Write keyframes and edges as a pose graph: ``VERTEX_SE3:QUAT``, ``EDGE_SE3:QUAT``.

    Vertices hold the pose camera to world, an edge from i to j the pose of camera j in camera i, as
    x, y, z, then the quaternion x, y, z, w; its information matrix (6, 6), upper triangle, is the
    identity (R. Kümmerle et al., "g2o: A general framework for graph optimization", ICRA 2011; the
    types ``SE3:QUAT`` of its library slam3d). Edges are those of the spanning tree, of strong
    covisibility, and of closed loops, each once; they have the relative poses of the map and
    therefore no error. Keyframe 0 is fixed.

    Parameters
    ----------
    contents
        The map; the unit of length does not change (one camera: the map's own, as a comment says).
    path
        The file; replaced only after everything is written.
    least_weight
        Least number of shared points of an edge of covisibility.

    Raises
    ------
    MapFileError
        If `contents` or `path` is invalid.
    OSError
        If it cannot be written; an existing file is kept then.
    """
    keyframes = contents_of(contents).keyframes
    path = path_of(path, "the file of the pose graph", MapFileError)
    T_wc = keyframes.T_wc
    edges = pose_graph_edges(contents, least_weight)
    i, j = np.searchsorted(keyframes.ids, edges).T
    T_ij = inverse_poses(T_wc[i]) @ T_wc[j]
    with atomic_write(path) as stream:
        stream.write("# keyframes of a map and what links them; lengths in ")
        stream.write(f"{'metres' if unit_of(contents) == 'm' else 'units'}\n")
        if unit_of(contents) != "m":
            stream.write(_OWN_UNIT)
        if not sees_metres(contents):
            stream.write(_DRIFT)
        for number, pose in zip(keyframes.ids.tolist(), _numbers(T_wc), strict=True):
            stream.write(f"VERTEX_SE3:QUAT {number} {pose}\n")
        if len(keyframes):
            stream.write(f"FIX {keyframes.ids[0]}\n")
        for (a, b), pose in zip(edges.tolist(), _numbers(T_ij), strict=True):
            stream.write(f"EDGE_SE3:QUAT {a} {b} {pose} {_INFORMATION}\n")


def pose_graph_edges(contents: MapContents, least_weight: int) -> IntArray:
    """Return pairs of ids (e, 2), the lower id first: tree, strong covisibility, loops."""
    keyframes, covisibility = contents.keyframes, contents.covisibility
    child = keyframes.parent >= 0
    strong = covisibility.weight >= least_weight
    pairs = np.concatenate(
        [
            np.column_stack([keyframes.parent[child], keyframes.ids[child]]),
            np.column_stack([covisibility.a[strong], covisibility.b[strong]]),
            contents.loop_edges.reshape(-1, 2),
        ]
    )
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _numbers(T: FloatArray) -> list[str]:
    """Return positions and quaternions of poses (n, 4, 4), with all digits."""
    rows = np.column_stack([T[:, :3, 3], quaternions_from_rotations(T[:, :3, :3])])
    return [" ".join(map(repr, row)) for row in rows.tolist()]
