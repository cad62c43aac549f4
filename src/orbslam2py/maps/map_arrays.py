# SPDX-License-Identifier: BSD-3-Clause
"""The drawn parts of a map as a small file of arrays: map.npz in the folder of a run."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import path_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._files import atomic_write
from orbslam2py.errors import MapFileError
from orbslam2py.maps.changes import MapFollower
from orbslam2py.trajectory.level import moved
from orbslam2py.trajectory.rotations import inverse_poses

_FORMAT = 1


@dataclass(frozen=True, eq=False)
class MapArrays:
    """Keyframes, points and edges of a map; enough to draw it, but not to continue it."""

    keyframe_ids: IntArray
    """(k,) ascending."""
    keyframe_T_wc: FloatArray
    """(k, 4, 4) camera to world."""
    keyframe_timestamps: FloatArray
    """(k,) seconds."""
    point_ids: IntArray
    """(p,) ascending."""
    point_positions: FloatArray
    """(p, 3) world [m] (one camera: the map's own units)."""
    point_observations: IntArray
    """(p,) see `PointsSet.observation_counts`."""
    point_first_keyframes: IntArray
    """(p,) id of the earliest of the keyframes that see the point."""
    covisibility: IntArray
    """(e, 2) ids of keyframes that share many points."""
    spanning_tree: IntArray
    """(t, 2) ids of a keyframe and its parent."""
    loop_edges: IntArray
    """(l, 2) ids of keyframes that a loop connects."""

    @classmethod
    def of(cls, slam_map: core.Map, map_index: int | None = None) -> MapArrays:
        """Copy the drawn parts of a map at rest, in the world of its trajectory.

        That is the frame of its first keyframe; an upright map keeps its own world.

        Parameters
        ----------
        slam_map
            The map or maps.
        map_index
            Number of the map; None: the active one.
        """
        changes = MapFollower(slam_map, map_index=map_index).update()
        seen = core.snapshot_observations(slam_map, -1 if map_index is None else map_index)
        first = np.full(len(seen.ids), -1, np.int64)
        observed = np.diff(seen.offsets) > 0
        if observed.any():
            first[observed] = np.minimum.reduceat(seen.keyframes, seen.offsets[:-1][observed])
        keyframes, points = changes.keyframes_set, changes.points_set
        rows = np.searchsorted(seen.ids, points.ids)
        arrays = cls(
            keyframe_ids=keyframes.ids,
            keyframe_T_wc=keyframes.T_wc,
            keyframe_timestamps=keyframes.timestamps,
            point_ids=points.ids,
            point_positions=points.positions,
            point_observations=points.observation_counts,
            point_first_keyframes=first[rows] if len(seen.ids) else first,
            covisibility=_pairs(changes.covisibility),
            spanning_tree=_pairs(changes.spanning_tree),
            loop_edges=_pairs(changes.loop_edges),
        )
        which = slam_map.active_map if map_index is None else map_index
        if not len(arrays.keyframe_ids) or slam_map.is_upright(which):
            return arrays
        return arrays.moved(inverse_poses(arrays.keyframe_T_wc[0]))

    def moved(self, T: FloatArray) -> MapArrays:
        """Return the same map in another world; the transform (4, 4) leads to it."""
        return replace(
            self,
            keyframe_T_wc=T @ self.keyframe_T_wc,
            point_positions=moved(T, self.point_positions),
        )

    def save(self, path: str | Path) -> None:
        """Write a compressed NumPy file; positions of points as float32.

        Raises
        ------
        MapFileError
            If the path is invalid.
        OSError
            If it cannot be written.
        """
        path = path_of(path, "the file of the map", MapFileError)
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays["point_positions"] = self.point_positions.astype(np.float32)
        with atomic_write(path, binary=True) as stream:
            np.savez_compressed(stream, format=np.array(_FORMAT), **arrays)

    @classmethod
    def load(cls, path: str | Path) -> MapArrays:
        """Read a file of `save`.

        Raises
        ------
        MapFileError
            If it is no such file or is incomplete; the message names the file.
        OSError
            If it cannot be read.
        """
        path = path_of(path, "the file of the map", MapFileError)
        try:
            with np.load(path, allow_pickle=False) as file:
                found = {field.name: file[field.name] for field in fields(cls)}
        except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
            raise MapFileError(
                f"{path} is no file of a map, or not whole; run the sequence again to have one"
            ) from error
        found["point_positions"] = found["point_positions"].astype(np.float64)
        arrays = cls(**found)
        k, p = len(arrays.keyframe_ids), len(arrays.point_ids)
        if arrays.keyframe_T_wc.shape != (k, 4, 4) or arrays.point_positions.shape != (p, 3):
            raise MapFileError(f"{path} is damaged: its arrays do not belong together")
        return arrays


def _pairs(pairs: IntArray | None) -> IntArray:
    return np.zeros((0, 2), np.int64) if pairs is None else np.asarray(pairs, np.int64)
