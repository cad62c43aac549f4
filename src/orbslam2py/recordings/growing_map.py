# SPDX-License-Identifier: BSD-3-Clause
"""The map as known to a watcher, and the trajectory of the camera in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.maps import MapChanges
from orbslam2py.pictures.top_view import MapPicture
from orbslam2py.slam.records import TrackingRecord

_NO_EDGES = np.zeros((0, 2), np.int64)


class GrowingMap:
    """Applies the changes of a map, and returns the contents of its top view.

    The index of all arrays is the id: ids are assigned in order, and few are removed.
    """

    def __init__(self) -> None:
        self.map_index = -1
        self._forget()

    def _forget(self) -> None:
        self._points = _Table(3, np.float32)
        self._poses = _Table(16, np.float64)
        self._parents = _Table(1, np.int64)
        self._covisibility = self._loops = _NO_EDGES
        self._path = _Path()
        self._told: MapPicture | None = None

    @property
    def n_keyframes(self) -> int:
        """Keyframes in the map."""
        return self._poses.count

    @property
    def n_points(self) -> int:
        """Points in the map."""
        return self._points.count

    def apply(self, changes: MapChanges) -> None:
        """Apply the changes."""
        if changes.restarted:
            later = self._path.of_map(changes.map_index)
            self._forget()
            self._path = later
            self.map_index = changes.map_index
        self._path.hang_on_parents(changes.keyframes_removed, self._poses, self._parents)
        self._poses.remove(changes.keyframes_removed)
        self._points.remove(changes.points_removed)
        keyframes, points = changes.keyframes_set, changes.points_set
        self._poses.set(keyframes.ids, keyframes.T_wc.reshape(-1, 16))
        self._parents.set(keyframes.ids, keyframes.parents[:, None])
        self._points.set(points.ids, points.positions)
        if changes.covisibility is not None:
            self._covisibility = changes.covisibility
        if changes.loop_edges is not None:
            self._loops = changes.loop_edges
        self._path.hang(self._poses)

    def add_frame(self, record: TrackingRecord) -> None:
        """Add a frame to the trajectory, with or without a pose."""
        self._path.add(record)
        if record.map_index == self.map_index:
            self._path.hang(self._poses)

    def picture(self, local_points: IntArray | None = None, *, renew: bool = True) -> MapPicture:
        """Return the present contents.

        Parameters
        ----------
        local_points : array of int64, (l,), optional
            Ids of the highlighted points.
        renew : bool
            Whether to update points, keyframes and covisibility; otherwise they are those of the
            last picture.
        """
        if renew or self._told is None:
            self._told = MapPicture(
                points=self._points.values(),
                keyframes=self._poses.values().reshape(-1, 4, 4),
                covisibility=self._edges(self._covisibility),
            )
        path, gaps = self._path.positions(self.map_index, self._poses)
        return replace(
            self._told,
            local_points=self._points.some(local_points),
            loop_edges=self._edges(self._loops),
            path=path,
            path_gaps=gaps,
        )

    def path(self) -> tuple[FloatArray, FloatArray]:
        """Return the trajectory in the present map: time stamps (n,) [s], positions (n, 3)."""
        positions, _ = self._path.positions(self.map_index, self._poses)
        return self._path.times(self.map_index), positions

    def points_between(self, first: int, end: int) -> npt.NDArray[np.floating]:
        """Return positions (p, 3) of the points with ids from `first` to before `end`."""
        return self._points.between(first, end)

    def keyframes_between(self, first: int, end: int) -> npt.NDArray[np.floating]:
        """Return poses (k, 4, 4), camera to world, of the keyframes with these ids."""
        return self._poses.between(first, end).reshape(-1, 4, 4)

    def _edges(self, pairs: IntArray) -> npt.NDArray[np.floating]:
        """Return positions of both ends (e, 2, 3) of pairs of keyframes."""
        known = self._poses.holds(pairs).all(axis=1)
        ends: npt.NDArray[np.floating] = self._poses.rows(pairs[known].ravel())[
            :, [3, 7, 11]
        ].reshape(-1, 2, 3)
        return ends


class _Table:
    """Rows by id."""

    def __init__(self, width: int, kind: npt.DTypeLike) -> None:
        self._rows = np.zeros((0, width), kind)
        self._alive = np.zeros(0, bool)
        self.count = 0

    def set(self, ids: IntArray, rows: npt.NDArray[np.generic]) -> None:
        if not len(ids):
            return
        needed = int(ids.max()) + 1
        if needed > len(self._rows):
            more = max(needed, 2 * len(self._rows), 256) - len(self._rows)
            self._rows = np.pad(self._rows, ((0, more), (0, 0)))
            self._alive = np.pad(self._alive, (0, more))
        self._rows[ids] = rows
        self._alive[ids] = True
        self.count = int(np.count_nonzero(self._alive))

    def remove(self, ids: IntArray) -> None:
        self._alive[ids[ids < len(self._alive)]] = False
        self.count = int(np.count_nonzero(self._alive))

    def holds(self, ids: IntArray) -> npt.NDArray[np.bool_]:
        inside = (ids >= 0) & (ids < len(self._alive))
        held = np.zeros(ids.shape, bool)
        held[inside] = self._alive[ids[inside]]
        return held

    def values(self) -> npt.NDArray[np.floating]:
        return self._rows[self._alive]

    def between(self, first: int, end: int) -> npt.NDArray[np.floating]:
        return self._rows[first:end][self._alive[first:end]]

    def rows(self, ids: IntArray) -> npt.NDArray[np.floating]:
        return self._rows[ids]

    def some(self, ids: IntArray | None) -> npt.NDArray[np.floating]:
        return self._rows[:0] if ids is None else self._rows[ids[self.holds(ids)]]


class _Path:
    """Poses of all frames relative to their reference keyframes, so that they follow the map."""

    def __init__(self) -> None:
        self._n = 0
        #: Map, reference keyframe (-1: none yet), whether that one's pose is used.
        self._marks = np.zeros((256, 3), np.int64)
        #: In the world as tracked, then in the camera of the reference keyframe.
        self._places = np.zeros((256, 6))
        self._seconds = np.zeros(256)

    def add(self, record: TrackingRecord) -> None:
        if self._n == len(self._marks):
            self._marks = np.pad(self._marks, ((0, self._n), (0, 0)))
            self._places = np.pad(self._places, ((0, self._n), (0, 0)))
            self._seconds = np.pad(self._seconds, (0, self._n))
        T_wc = record.T_wc
        self._marks[self._n] = (record.map_index, record.reference_keyframe, 0)
        self._places[self._n] = np.nan if T_wc is None else np.tile(T_wc[:3, 3], 2)
        self._seconds[self._n] = record.timestamp
        self._n += 1

    def of_map(self, map_index: int) -> _Path:
        """The frames of one map; those of others are dropped."""
        chosen = np.flatnonzero(self._marks[: self._n, 0] == map_index)
        path = _Path()
        path._n = len(chosen)
        spare = ((0, 256), (0, 0))
        path._marks = np.pad(self._marks[chosen], spare)
        path._places = np.pad(self._places[chosen], spare)
        path._seconds = np.pad(self._seconds[chosen], (0, 256))
        return path

    def hang(self, poses: _Table) -> None:
        """Attach frames to their keyframes, as soon as these are known."""
        marks = self._marks[: self._n]
        waiting = np.flatnonzero((marks[:, 2] == 0) & poses.holds(marks[:, 1]))
        self._relate(waiting, poses)

    def hang_on_parents(self, removed: IntArray, poses: _Table, parents: _Table) -> None:
        """Attach frames to the parents of keyframes that will be removed."""
        if not len(removed):
            return
        marks = self._marks[: self._n]
        orphans = np.flatnonzero((marks[:, 2] == 1) & np.isin(marks[:, 1], removed))
        self._places[orphans, :3] = self._world(orphans, poses)
        gone = set(removed.tolist())
        for keyframe in np.unique(marks[orphans, 1]).tolist():
            parent = keyframe
            while parent in gone and parent >= 0:
                parent = int(parents.rows(np.array([parent]))[0, 0])
            marks[orphans[marks[orphans, 1] == keyframe], 1:] = (parent, 0)
        self._relate(orphans[poses.holds(marks[orphans, 1])], poses)

    def _relate(self, which: IntArray, poses: _Table) -> None:
        T_wk = poses.rows(self._marks[which, 1]).reshape(-1, 4, 4)
        offset = self._places[which, :3] - T_wk[:, :3, 3]
        self._places[which, 3:] = np.einsum("nji,nj->ni", T_wk[:, :3, :3], offset)
        self._marks[which, 2] = 1

    def _world(self, which: IntArray, poses: _Table) -> FloatArray:
        T_wk = poses.rows(self._marks[which, 1]).reshape(-1, 4, 4)
        turned = np.einsum("nij,nj->ni", T_wk[:, :3, :3], self._places[which, 3:])
        return np.asarray(turned + T_wk[:, :3, 3], np.float64)

    def times(self, map_index: int) -> FloatArray:
        """Return the time stamps (n,) of `positions`."""
        found = self._marks[: self._n, 0] == map_index
        found &= np.isfinite(self._places[: self._n, 0])
        return np.array(self._seconds[: self._n][found])

    def positions(self, map_index: int, poses: _Table) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return positions (n, 3) of a map's frames with a pose, and the gaps before them."""
        marks = self._marks[: self._n]
        places = self._places[: self._n, :3].copy()
        hung = np.flatnonzero(marks[:, 2] == 1)
        places[hung] = self._world(hung, poses)
        found = (marks[:, 0] == map_index) & np.isfinite(places[:, 0])
        gaps = found & ~np.append(False, found[:-1])
        return places[found], gaps[found]
