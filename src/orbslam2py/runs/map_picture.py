# SPDX-License-Identifier: BSD-3-Clause
"""The picture of one or more saved maps: trajectories of the runs, keyframes, points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.maps.units import unit_of
from orbslam2py.runs.gravity import Height
from orbslam2py.runs.plots import draw_trajectory
from orbslam2py.runs.several_maps import draw_maps, maps_of_file
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.level import level_frame, moved


def draw_map(path: Path, saved: SavedMap, *, title: str) -> None:
    """Draw a saved map into a picture, in the axes of the first keyframe's camera.

    An upright map is drawn in level axes (`level_frame`).

    Each of several maps has a separate panel, colour and world.

    Parameters
    ----------
    path
        The file; its suffix determines the format, PNG without one.
    saved
        The map or maps.
    title
        First line above the picture.

    Raises
    ------
    OutputFileError
        If the suffix is of no known format of pictures.
    OSError
        If the file cannot be written.
    """
    contents = saved.contents
    keyframes = contents.keyframes
    if np.count_nonzero(keyframes.parent < 0) > 1:
        draw_maps(path, maps_of_file(saved), title=title, unit=unit_of(contents))
        return
    is_upright = len(contents.upright_roots) > 0
    # From the world of paths, and from that of the map.
    T_d0 = level_frame(keyframes.T_wc[0]) if is_upright else np.eye(4)
    T_dw = T_d0 @ contents.anchor()
    paths = [saved.trajectory(run) for run in range(len(saved.runs))]
    paths = [one.select(~one.lost) for one in paths if not one.lost.all()]
    if not paths:
        paths = [Trajectory(keyframes.timestamps, contents.anchor() @ keyframes.T_wc)]
    seconds, gaps = _one_after_the_other(paths)
    rows = np.searchsorted(keyframes.ids, contents.loop_edges)
    centres = moved(T_dw, keyframes.T_wc[:, :3, 3])
    draw_trajectory(
        path,
        title=title,
        subtitle=f"{number_of(len(saved.runs), 'run')}, {number_of(len(keyframes), 'keyframe')}, "
        f"{number_of(len(contents.points), 'point')}",
        positions=moved(T_d0, np.concatenate([one.positions for one in paths])),
        seconds=seconds,
        keyframes=centres,
        points=moved(T_dw, contents.points.positions),
        loops=centres[rows],
        gaps=gaps,
        unit=unit_of(contents),
        height=Height.of_level_axes() if is_upright else None,
    )


def _one_after_the_other(paths: list[Trajectory]) -> tuple[FloatArray, np.ndarray]:
    """Return the times of all poses as if the runs were consecutive, and the gaps."""
    seconds, gaps, begin = [], [], 0.0
    for one in paths:
        since = one.timestamps - one.timestamps[0]
        # Lost frames have been left out: their numbers are missing.
        missing = np.diff(one.indices, prepend=one.indices[0]) > 1
        missing[0] = begin > 0
        seconds.append(begin + since)
        gaps.append(missing)
        begin += float(since[-1]) + 1.0
    return np.concatenate(seconds), np.concatenate(gaps)
