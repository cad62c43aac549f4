# SPDX-License-Identifier: BSD-3-Clause
"""The drawn parts of several maps, from a run or from a map file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.maps.edits.parts import map_numbers, take_map
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.maps.snapshot import MapSnapshot
from orbslam2py.runs.report import maps_entry
from orbslam2py.runs.result import RunResult, empty_snapshot
from orbslam2py.runs.timeline import gaps_in_time
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.level import level_frame, moved
from orbslam2py.trajectory.rotations import inverse_poses


@dataclass(frozen=True, eq=False)
class DrawnMap:
    """One map, in the axes of its first keyframe; an upright map in level ones."""

    number: int
    state: str
    """``active``, ``rests``, ``given up``; empty if no system uses it."""
    positions: FloatArray
    """(n, 3) positions of the camera, in the unit of the map."""
    gaps: npt.NDArray[np.bool_]
    """(n,) whether the trajectory is interrupted before each."""
    keyframes: FloatArray
    """(k, 3) positions."""
    points: FloatArray
    """(p, 3)"""
    loops: FloatArray
    """(l, 2, 3) both keyframes of every loop."""

    @property
    def title(self) -> str:
        """Number, state and size."""
        state = f", {self.state}" if self.state else ""
        size = f"{number_of(len(self.keyframes), 'keyframe')}, {len(self.points)} points"
        if not len(self.keyframes):
            size = number_of(len(self.positions), "pose")
        return f"map {self.number}{state}: {size}"


def maps_of_run(result: RunResult) -> list[DrawnMap]:
    """Return the maps of a run with a trajectory, also dropped ones, the oldest first."""
    snapshots = {one.map_index: one for one in result.other_maps}
    snapshots[result.main_map] = result.snapshot
    drawn = []
    for entry in maps_entry(result):
        path = result.trajectories[entry["map"]]
        path = path.select(~path.lost)
        if len(path):
            state = entry["state"].replace("resting", "rests")
            snapshot = snapshots.get(entry["map"], empty_snapshot())
            drawn.append(_drawn(entry["map"], state, [path], snapshot))
    return drawn


def maps_of_file(saved: SavedMap) -> list[DrawnMap]:
    """Return all maps of a map file, the oldest first."""
    numbers = np.unique(map_numbers(saved.contents.keyframes)).tolist()
    return [map_of_file(take_map(saved, number), number) for number in numbers]


def map_of_file(saved: SavedMap, number: int) -> DrawnMap:
    """Return a map file with one map: the trajectories of its runs, or else of its keyframes."""
    contents = saved.contents
    keyframes, points = contents.keyframes, contents.points
    paths = [saved.trajectory(run) for run in range(len(saved.runs))]
    paths = [one.select(~one.lost) for one in paths if not one.lost.all()]
    if not paths:
        paths = [Trajectory(keyframes.timestamps, contents.anchor() @ keyframes.T_wc)]
    snapshot = MapSnapshot(
        keyframes.ids, keyframes.timestamps, keyframes.T_wc,
        points.ids, points.positions, contents.loop_edges,
        is_upright=len(contents.upright_roots) > 0,
    )  # fmt: skip
    return _drawn(number, "", paths, snapshot)


def _drawn(number: int, state: str, paths: Sequence[Trajectory], snapshot: MapSnapshot) -> DrawnMap:
    # From the world of paths, and from that of the map.
    T_d0 = T_dw = np.eye(4)
    if snapshot.is_upright:
        T_d0 = T_dw = level_frame(snapshot.keyframe_T_wc[0])
    elif len(snapshot.keyframe_ids):
        T_dw = inverse_poses(snapshot.keyframe_T_wc[0])
    centres = moved(T_dw, snapshot.keyframe_T_wc[:, :3, 3])
    return DrawnMap(
        number=number,
        state=state,
        positions=moved(T_d0, np.concatenate([path.positions for path in paths])),
        gaps=np.concatenate([_gaps(path, first=k == 0) for k, path in enumerate(paths)]),
        keyframes=centres,
        points=moved(T_dw, snapshot.point_positions),
        loops=centres[np.searchsorted(snapshot.keyframe_ids, snapshot.loop_edges)],
    )


def _gaps(path: Trajectory, *, first: bool) -> npt.NDArray[np.bool_]:
    gaps = gaps_in_time(path.timestamps)
    gaps[1:] |= _missing(path.indices)
    gaps[:1] = not first  # runs are not connected
    return gaps


def _missing(indices: IntArray) -> npt.NDArray[np.bool_]:
    """Return whether lost frames are left out between two."""
    return np.asarray(np.diff(indices) > 1)
