# SPDX-License-Identifier: BSD-3-Clause
"""When a single camera could have begun a map, when it did, and whether the map was right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.holding_on.play import Flags, Played
from orbslam2py.trajectory import align
from orbslam2py.trajectory.rotations import inverse_poses

ENOUGH = np.radians(1.5)  # median parallax of two views within a second
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
    return float(played.scene.timestamps[np.argmax(played.posed)])


def enough_parallax_at(played: Played) -> float:
    """Seconds until a frame and one of the second before it see common points at 1.5 degrees."""
    scene = played.scene
    fps = max(1, round(scene.fps))
    every = max(1, fps // 5)
    for j in range(1, len(scene)):
        for i in range(max(0, j - fps) // every * every, j, every):
            if played.covered[i] or played.covered[j]:
                continue
            if scene.parallax(i, j) >= ENOUGH:
                return float(scene.timestamps[j])
    return float("nan")


def wrong_map(played: Played, frames: Flags) -> bool:
    """Whether the first frames of a map are off by more than a tenth of their way, aligned."""
    known = np.isfinite(played.truth).all(axis=(1, 2))
    first = np.flatnonzero(frames & known)[:_FIRST_FRAMES]
    if len(first) < _FEWEST_FRAMES:
        return False
    told = inverse_poses(played.T_cw[first])[:, :3, 3]
    true = inverse_poses(played.truth[first])[:, :3, 3]
    length = float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum())
    if length < 0.05:
        return False  # it stood still: there is no path to compare
    moved = align(told, true, with_scale=True).apply(told)
    return float(np.sqrt(np.mean(np.sum((moved - true) ** 2, axis=1)))) > _WRONG_SHARE * length
