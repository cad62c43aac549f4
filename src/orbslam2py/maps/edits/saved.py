# SPDX-License-Identifier: BSD-3-Clause
"""A part of a saved map, with the frames and images that belong to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.maps.edits.crop import BoolArray, keep_keyframes
from orbslam2py.maps.saved_map import RecordedFrames, SavedMap, saved_of


def crop_saved_map(
    saved: SavedMap, kept: BoolArray, kept_points: BoolArray | None = None
) -> SavedMap:
    """Keep some keyframes of a saved map, and all that belongs to them.

    Parameters
    ----------
    saved
        The map.
    kept
        Mask of the keyframes, bool (k,), at least one of them true.
    kept_points
        Mask of the points that may be kept, bool (p,); all of them by default.

    Returns
    -------
    SavedMap
        The map of `keep_keyframes`, without the frames and images of removed keyframes.

    Raises
    ------
    MapFileError
        If no keyframe is kept, or an argument is invalid.
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
    """Return the frames of these keyframes, with the new ids."""
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
