# SPDX-License-Identifier: BSD-3-Clause
"""The same maps with other numbers of keyframes, as another order of the images would give."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py.maps import Covisibility, Keyframes, Observations, SavedMap

_OF_KEYPOINTS = {
    *("keypoints", "raw_keypoints", "octave", "angle", "response", "descriptors", "depth"),
    *("right_u", "colours", "words"),
}


def renumbered(saved: SavedMap, order: NDArray[np.int64]) -> SavedMap:
    """Give keyframes the numbers from 0 on in another order.

    Parameters
    ----------
    saved
        A map whose keyframes have the numbers 0 to k - 1, none removed.
    order
        (k,) which keyframe gets each number.
    """
    contents = saved.contents
    k = len(order)
    assert contents.keyframes.ids.tolist() == list(range(k))
    new = np.empty(k + 1, np.int64)  # the last one is for -1
    new[order], new[-1] = np.arange(k), -1
    seen, edges, points = contents.observations, contents.covisibility, contents.points
    by_point = np.lexsort((new[seen.keyframe], seen.point))
    a, b = np.sort(np.stack([new[edges.a], new[edges.b]]), axis=0)
    by_pair = np.lexsort((b, a))
    loops = np.sort(new[contents.loop_edges], axis=1)
    changed = replace(
        contents,
        keyframes=_in_order(contents.keyframes, order, new),
        points=replace(
            points,
            reference_keyframe=new[points.reference_keyframe],
            first_keyframe=new[points.first_keyframe],
        ),
        observations=Observations(
            seen.point[by_point], new[seen.keyframe][by_point], seen.keypoint[by_point]
        ),
        covisibility=Covisibility(a[by_pair], b[by_pair], edges.weight[by_pair]),
        loop_edges=loops[np.lexsort(loops.T[::-1])],
    )
    runs = tuple(
        replace(run, frames=replace(run.frames, keyframes=new[run.frames.keyframes]))
        for run in saved.runs
    )
    images = {int(new[number]): image for number, image in saved.images.items()}
    return replace(saved, contents=changed, runs=runs, images=images)


def _in_order(keyframes: Keyframes, order: NDArray[np.int64], new: NDArray[np.int64]) -> Keyframes:
    rows = [keyframes.keypoints_of(int(row)) for row in order]
    counts = [row.stop - row.start for row in rows]
    arrays: dict[str, Any] = {}
    for name, array in keyframes.arrays():
        if name in _OF_KEYPOINTS:
            arrays[name] = np.concatenate([array[row] for row in rows]) if len(array) else array
        elif name == "offsets":
            arrays[name] = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        else:
            arrays[name] = array[order]
    arrays["ids"] = np.arange(len(order))
    arrays["parent"] = new[arrays["parent"]]
    return Keyframes(**arrays)
