# SPDX-License-Identifier: BSD-3-Clause
"""A part of a saved map, with the frames of its runs and its images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.maps.edits.crop import BoolArray, keep_keyframes
from orbslam2py.maps.saved_map import RecordedFrames, SavedMap, saved_of


def crop_saved_map(
    saved: SavedMap, kept: BoolArray, kept_points: BoolArray | None = None
) -> SavedMap:
    """Keep some keyframes of a saved map, and all that hangs on them.

    Parameters
    ----------
    saved
        The map.
    kept
        Which keyframes, bool (k,), at least one.
    kept_points
        Which points may stay, bool (p,); all of them by default.

    Returns
    -------
    SavedMap
        With the map that `keep_keyframes` gives; frames of its runs that hang on keyframes that
        went are left out, and so are these keyframes' images.

    Raises
    ------
    MapFileError
        If no keyframe is kept, or one of them is something else.
    """
    saved_of(saved)
    contents = keep_keyframes(saved.contents, kept, kept_points)
    old = saved.contents.keyframes.ids[np.asarray(kept)]
    new = dict(zip(old.tolist(), contents.keyframes.ids.tolist(), strict=True))
    ids = np.concatenate([old, contents.removed_keyframes.ids])
    renumbered = np.concatenate([contents.keyframes.ids, contents.removed_keyframes.ids])
    runs = tuple(
        replace(run, frames=_hanging_on(run.frames, ids, renumbered)) for run in saved.runs
    )
    images = {new[number]: image for number, image in saved.images.items() if number in new}
    return replace(saved, contents=contents, runs=runs, images=images)


def _hanging_on(frames: RecordedFrames, ids: IntArray, new_ids: IntArray) -> RecordedFrames:
    """Frames whose keyframe is one of these, which have new numbers."""
    order = np.argsort(ids)
    place = np.minimum(np.searchsorted(ids[order], frames.keyframes), len(ids) - 1)
    stay = ids[order][place] == frames.keyframes
    return RecordedFrames(
        timestamps=frames.timestamps[stay],
        ids=frames.ids[stay],
        keyframes=new_ids[order][place][stay],
        T_cr=frames.T_cr[stay],
        lost=frames.lost[stay],
    )
