# SPDX-License-Identifier: BSD-3-Clause
"""Whether two saved maps are equal, and otherwise where and by how much they differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.saved_map import SavedMap, saved_of


def map_differences(first: SavedMap, second: SavedMap) -> list[str]:
    """Compare the contents of two map files bit by bit; names of files and programs are ignored.

    Returns
    -------
    list of str
        One sentence for each difference; empty if there is none.

    Raises
    ------
    MapFileError
        If one of them is not a `SavedMap`, for example a path.
    """
    saved_of(first, "the first map")
    saved_of(second, "the second map")
    return [
        *_settings(first, second),
        *_contents(first.contents, second.contents),
        *_runs(first, second),
        *_images(first, second),
    ]


def _settings(first: SavedMap, second: SavedMap) -> Iterator[str]:
    if first.sensor is not second.sensor:
        yield f"sensor: {first.sensor} and {second.sensor}"
    lines = [saved.settings.to_yaml().splitlines() for saved in (first, second)]
    for mine, theirs in zip(*lines, strict=False):
        if mine != theirs:
            yield f"settings: '{mine}' and '{theirs}'"
    if len(lines[0]) != len(lines[1]):
        yield f"settings: {len(lines[0])} and {len(lines[1])} lines"
    if first.vocabulary.hash != second.vocabulary.hash:
        yield f"vocabulary: {first.vocabulary.hash} and {second.vocabulary.hash}"


def _contents(first: MapContents, second: MapContents) -> Iterator[str]:
    for name in ("next_keyframe", "next_point"):
        if getattr(first, name) != getattr(second, name):
            yield f"{name}: {getattr(first, name)} and {getattr(second, name)}"
    for which, one, other in (("first", first, second), ("second", second, first)):
        for root in sorted({*one.metric_roots} - {*other.metric_roots}):
            roots = one.keyframes.ids[one.keyframes.parent < 0]
            yield f"metres: map {np.searchsorted(roots, root)} only in the {which}"
        for root in sorted({*one.upright_roots} - {*other.upright_roots}):
            roots = one.keyframes.ids[one.keyframes.parent < 0]
            yield f"upright: map {np.searchsorted(roots, root)} only in the {which}"
    unlike: set[str] = set()  # groups whose rows do not belong together
    for (name, mine), (_, theirs) in zip(first.arrays(), second.arrays(), strict=True):
        group, _, field = name.rpartition(".")
        if group in unlike or (field == "words" and not (len(mine) and len(theirs))):
            continue
        if field == "ids" and not np.array_equal(mine, theirs):
            unlike.add(group)
            yield f"{group}: {_of_ids(mine, theirs)}"
        elif mine.shape != theirs.shape or mine.dtype != theirs.dtype:
            yield f"{name}: {_shape(mine)} and {_shape(theirs)}"
        elif mine.tobytes() != theirs.tobytes():
            yield f"{name}: {_of_rows(mine, theirs)}"


def _runs(first: SavedMap, second: SavedMap) -> Iterator[str]:
    if len(first.runs) != len(second.runs):
        yield f"runs: {len(first.runs)} and {len(second.runs)}"
    for number, (mine, theirs) in enumerate(zip(first.runs, second.runs, strict=False)):
        for name in ("timestamps", "ids", "keyframes", "T_cr", "lost"):
            one, other = getattr(mine.frames, name), getattr(theirs.frames, name)
            if one.shape != other.shape:
                yield f"frames of run {number}: {len(one)} and {len(other)}"
                break
            if one.tobytes() != other.tobytes():
                yield f"{name} of run {number}: {_of_rows(one, other)}"


def _images(first: SavedMap, second: SavedMap) -> Iterator[str]:
    if first.images.keys() != second.images.keys():
        yield f"images: of {len(first.images)} and {len(second.images)} keyframes"
        return
    unlike = [number for number in first.images if first.images[number] != second.images[number]]
    if unlike:
        yield f"images: those of {len(unlike)} of {len(first.images)} keyframes"


def _of_ids(mine: NDArray[np.int64], theirs: NDArray[np.int64]) -> str:
    return (
        f"{len(mine)} and {len(theirs)}; {len(np.setdiff1d(mine, theirs))} only in the first, "
        f"{len(np.setdiff1d(theirs, mine))} only in the second"
    )


def _shape(array: NDArray[Any]) -> str:
    return f"{' x '.join(map(str, array.shape))} {array.dtype}"


def _of_rows(mine: NDArray[Any], theirs: NDArray[Any]) -> str:
    unequal = mine != theirs
    rows = unequal.reshape(len(mine), -1).any(axis=1)
    text = f"{int(rows.sum())} of {len(mine)} rows"
    if mine.dtype.kind == "f" and rows.any():
        by = np.abs(mine.astype(np.float64) - theirs.astype(np.float64))[unequal].max()
        text += f", by at most {by:.3g}"
    return text if rows.any() else "bits of zeros or of NaN"
