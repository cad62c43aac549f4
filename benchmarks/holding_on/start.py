# SPDX-License-Identifier: BSD-3-Clause
"""When a single camera could have begun a map, when it did, and whether the map was right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.holding_on.play import Flags, Floats, Played
from orbslam2py.trajectory import align
from orbslam2py.trajectory.rotations import inverse_poses

ENOUGH = np.radians(1.5)  # median parallax of two views within a second
_OVERLAP = 0.5  # of the first view's points that the second must see
_WRONG_SHARE = 0.1
_FIRST_FRAMES = 30
_FEWEST_FRAMES = 10


@dataclass(frozen=True)
class StartFigures:
    """See `judgement.Figures`."""

    enough_parallax: float
    started: float
    wrong: int

    @staticmethod
    def of_depth(played: Played) -> StartFigures:
        """Of a sensor with depth: any view will do."""
        return StartFigures(0.0, started_at(played), 0)


def judge_start(played: Played) -> StartFigures:
    """Figures of a single camera's run."""
    maps = np.unique(played.map_index[played.posed])
    wrong = sum(wrong_map(played, played.posed & (played.map_index == number)) for number in maps)
    return StartFigures(enough_parallax_at(played), started_at(played), wrong)


def started_at(played: Played) -> float:
    """Seconds until the first pose; NaN without one."""
    if not played.posed.any():
        return float("nan")
    return float(played.sequence.timestamps[np.argmax(played.posed)])


def enough_parallax_at(played: Played) -> float:
    """Seconds until a frame and one of the second before it see common points at 1.5 degrees."""
    sequence = played.sequence
    fps = max(1, round(sequence.camera.fps))
    every = max(1, fps // 5)
    points: dict[int, Floats] = {}
    for j in range(1, len(sequence)):
        firsts = range(max(0, j - fps) // every * every, j, every)
        for i in firsts:
            if played.covered[i] or played.covered[j]:
                continue
            if i not in points:
                points[i] = points_in_view(played, i)
            if median_parallax(played, points[i], i, j) >= ENOUGH:
                return float(sequence.timestamps[j])
    return float("nan")


def points_in_view(played: Played, frame: int) -> Floats:
    """Points of the world (m, 3) on a coarse grid over a frame."""
    sequence, camera = played.sequence, played.sequence.camera
    depth = sequence.exact_depth(frame)
    rows = np.linspace(4, depth.shape[0] - 5, 12).astype(int)
    columns = np.linspace(4, depth.shape[1] - 5, 16).astype(int)
    y, x = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
    z = depth[y, x].astype(np.float64)
    seen = z > 0
    x, y, z = x[seen], y[seen], z[seen]
    rays = np.stack([(x - camera.cx) / camera.fx * z, (y - camera.cy) / camera.fy * z, z], axis=1)
    T_wc = inverse_poses(played.truth[frame])
    return np.asarray(rays @ T_wc[:3, :3].T + T_wc[:3, 3])


def median_parallax(played: Played, points: Floats, i: int, j: int) -> float:
    """Median angle [rad] at which both cameras see the first one's points; 0 without overlap."""
    camera = played.sequence.camera
    assert camera.width is not None and camera.height is not None
    T_cw = played.truth[j]
    seen = points @ T_cw[:3, :3].T + T_cw[:3, 3]
    ahead = seen[:, 2] > 0.05
    z = np.where(ahead, seen[:, 2], 1.0)
    u, v = camera.fx * seen[:, 0] / z + camera.cx, camera.fy * seen[:, 1] / z + camera.cy
    inside = ahead & (u > 0) & (v > 0) & (u < camera.width - 1) & (v < camera.height - 1)
    if len(points) == 0 or inside.mean() < _OVERLAP:
        return 0.0
    rays = [points[inside] - inverse_poses(played.truth[k])[:3, 3] for k in (i, j)]
    cosines = np.sum(rays[0] * rays[1], axis=1) / np.prod(
        [np.linalg.norm(ray, axis=1) for ray in rays], axis=0
    )
    return float(np.median(np.arccos(np.clip(cosines, -1, 1))))


def wrong_map(played: Played, frames: Flags) -> bool:
    """Whether the first frames of a map are off by more than a tenth of their way, aligned."""
    first = np.flatnonzero(frames)[:_FIRST_FRAMES]
    if len(first) < _FEWEST_FRAMES:
        return False
    told = inverse_poses(played.T_cw[first])[:, :3, 3]
    true = inverse_poses(played.truth[first])[:, :3, 3]
    length = float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum())
    if length < 0.05:
        return False  # it stood still: there is no path to compare
    moved = align(told, true, with_scale=True).apply(told)
    return float(np.sqrt(np.mean(np.sum((moved - true) ** 2, axis=1)))) > _WRONG_SHARE * length
