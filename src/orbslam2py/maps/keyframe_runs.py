# SPDX-License-Identifier: BSD-3-Clause
"""The run of each keyframe of a map, and the distance of the camera in each run."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.maps.content_groups import BoolArray
from orbslam2py.maps.saved_map import SavedMap


def runs_of_keyframes(saved: SavedMap) -> IntArray:
    """Number of the run of each keyframe, int64 (k,); 0 for all if it is not known.

    It is the first run with a frame of this time and keyframe: a later run may have found itself
    there at an equal time. A keyframe without such a frame gets the run of the previous one,
    because ids ascend from run to run.
    """
    keyframes = saved.contents.keyframes
    k = len(keyframes)
    found = np.full(k, -1, np.int64)
    for number, run in enumerate(saved.runs):
        frames = run.frames
        rows = np.minimum(np.searchsorted(keyframes.ids, frames.keyframes), k - 1)
        hangs = keyframes.ids[rows] == frames.keyframes
        made = rows[hangs & (keyframes.timestamps[rows] == frames.timestamps)]
        found[made[found[made] < 0]] = number
    told = np.flatnonzero(found >= 0)
    if not len(told):
        return np.zeros(k, np.int64)
    before = np.searchsorted(told, np.arange(k), side="right") - 1
    return np.asarray(found[told[np.maximum(before, 0)]])


def way_along(saved: SavedMap, chosen: BoolArray) -> float:
    """Length of the path from keyframe to keyframe, without the gaps between runs.

    Parameters
    ----------
    saved
        The map or maps.
    chosen
        Mask of the keyframes of one map, bool (k,).
    """
    positions = saved.contents.keyframes.T_wc[chosen, :3, 3]
    same_run = np.diff(runs_of_keyframes(saved)[chosen]) == 0
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return float(steps[same_run].sum())
