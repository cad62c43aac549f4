# SPDX-License-Identifier: BSD-3-Clause
"""Several maps in one file: take one out, put it back, combine files.

Each keyframe without a parent is the root of a map; ``docs/method/several_maps.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.content_groups import (
    AlignedSightings,
    ArrayGroup,
    BoolArray,
    Cameras,
    Covisibility,
    ImuStates,
    Keyframes,
    Observations,
    Patches,
    Points,
    RemovedKeyframes,
)
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.edits.saved import crop_saved_map
from orbslam2py.maps.edits.spanning_tree import map_numbers
from orbslam2py.maps.saved_map import Run, SavedMap

_Group = TypeVar("_Group", Keyframes, Points)

__all__ = ["crop_among_others", "map_numbers", "put_back", "put_together", "take_map"]


def take_map(saved: SavedMap, number: int | None = None) -> SavedMap:
    """Take one map from a file that may contain several.

    Parameters
    ----------
    saved
        The map file's contents.
    number
        Its number, from 0 for the oldest; not needed if there is only one.

    Returns
    -------
    SavedMap
        `saved` itself if it contains no other.

    Raises
    ------
    MapFileError
        If there is no such map, or no number is given and there are several.
    """
    numbers = map_numbers(saved.contents.keyframes)
    counts = np.bincount(numbers)
    told = ", ".join(f"{k} ({n} keyframes)" for k, n in enumerate(counts))
    name = saved.source or "the file"
    if number is None and len(counts) > 1:
        raise MapFileError(
            f"{name} holds {len(counts)} maps: {told}; say which one (--map, number)"
        )
    if number is not None and not 0 <= number < len(counts):
        raise MapFileError(f"{name} has no map {number}; it holds {told}")
    return saved if len(counts) == 1 else crop_saved_map(saved, numbers == number)


def crop_among_others(
    saved: SavedMap, number: int, kept: BoolArray, kept_points: BoolArray | None = None
) -> tuple[SavedMap, int]:
    """Keep some keyframes of one map of a file, and all of the other maps.

    Parameters
    ----------
    saved
        The map file's contents.
    number
        Which map.
    kept
        Mask of its keyframes, bool (k,), at least one of them true.
    kept_points
        Mask of its points that may be kept, bool (p,); all of them by default.

    Returns
    -------
    cropped
        All maps.
    number
        The new number of this map: maps are numbered by their first keyframes.
    """
    contents = saved.contents
    numbers = map_numbers(contents.keyframes)
    stay = numbers != number
    stay[~stay] = kept
    points = None
    if kept_points is not None:
        mine = np.isin(contents.points.ids, take_map(saved, number).contents.points.ids)
        points = ~mine
        points[mine] = kept_points
    cropped = crop_saved_map(saved, stay, points)
    left = map_numbers(cropped.contents.keyframes)
    left_here = numbers[stay] == number
    # The edges of the other maps have been counted again as well; their old values are restored.
    counted = _edges_among(cropped.contents.covisibility, cropped.contents.keyframes.ids[left_here])
    before = _edges_among(contents.covisibility, contents.keyframes.ids[numbers != number])
    old, new = contents.keyframes.ids[stay], cropped.contents.keyframes.ids
    ends = [new[np.searchsorted(old, end)] for end in (before.a, before.b)]
    a = np.concatenate([ends[0], counted.a])
    b = np.concatenate([ends[1], counted.b])
    order = np.lexsort((b, a))
    weight = np.concatenate([before.weight, counted.weight])[order]
    covisibility = Covisibility(a[order], b[order], weight)
    whole = replace(cropped, contents=replace(cropped.contents, covisibility=covisibility))
    return whole, int(left[left_here][0])


def _edges_among(edges: Covisibility, keyframe_ids: IntArray) -> Covisibility:
    """Return the edges between keyframes of one map, with their weights of the last count."""
    chosen = np.isin(edges.a, keyframe_ids)
    return Covisibility(edges.a[chosen], edges.b[chosen], edges.weight[chosen])


def put_back(saved: SavedMap, number: int, edited: MapContents) -> SavedMap:
    """Put a map that was moved or refined back into its file, beside the other maps.

    Parameters
    ----------
    saved
        The map file's contents.
    number
        Number of the map in the file (`take_map`).
    edited
        The map, with the same keyframes and points at other positions.

    Raises
    ------
    MapFileError
        If it has other keyframes or points, or other cameras.
    """
    contents = saved.contents
    rows = np.flatnonzero(map_numbers(contents.keyframes) == number)
    if len(rows) == len(contents.keyframes):  # there is no other
        return replace(saved, contents=edited)
    taken = take_map(saved, number).contents
    alike = (
        np.array_equal(taken.keyframes.ids, edited.keyframes.ids)
        and np.array_equal(taken.points.ids, edited.points.ids)
        and np.array_equal(_baselines(taken), _baselines(edited))
    )
    if not alike:
        raise MapFileError(
            f"these are not the keyframes and points of map {number}; give the map that take_map "
            "gave, moved or refined"
        )
    # Taken alone the map had another root number, but the same order.
    root = int(contents.keyframes.ids[rows[0]])
    metric = {*contents.metric_roots} - {root} | ({root} if edited.metric_roots else set())
    upright = {*contents.upright_roots} - {root} | ({root} if edited.upright_roots else set())
    points = np.searchsorted(contents.points.ids, edited.points.ids)
    return replace(
        saved,
        contents=replace(
            contents,
            keyframes=_placed(contents.keyframes, rows, edited.keyframes, _PLACES_OF_KEYFRAMES),
            points=_placed(contents.points, points, edited.points, _PLACES_OF_POINTS),
            metric_roots=tuple(sorted(metric)),
            upright_roots=tuple(sorted(upright)),
        ),
    )


def _baselines(contents: MapContents) -> FloatArray:
    """`Cameras.bf` of each keyframe (k,): the numbers of the cameras may differ."""
    return np.asarray(contents.cameras.bf[contents.keyframes.camera])


#: What says where things are, and how large. Depths are those of cameras that see metres, whose
#: maps keep their size.
_PLACES_OF_KEYFRAMES = ("rotations", "translations", "scale")
_PLACES_OF_POINTS = ("positions", "mean_directions", "min_distance", "max_distance")


def _placed(group: _Group, rows: IntArray, edited: _Group, names: tuple[str, ...]) -> _Group:
    changed = {}
    for name in names:
        array = getattr(group, name).copy()
        array[rows] = getattr(edited, name)
        changed[name] = array
    return replace(group, **changed)


def put_together(files: Sequence[SavedMap]) -> SavedMap:
    """Combine the maps of several files in one; each keeps its own world.

    Keyframes and points are numbered in the order of the files; settings and visual words are those
    of the first.

    Parameters
    ----------
    files
        At least one; of one camera and one vocabulary.
    """
    offsets = np.cumsum([0, *(saved.contents.next_keyframe for saved in files)])
    contents = _joined([saved.contents for saved in files])
    runs: list[Run] = []
    images: dict[int, bytes] = {}
    for saved, offset in zip(files, offsets.tolist(), strict=False):
        for run in saved.runs:
            keyframes = _shifted(run.frames.keyframes, offset)
            runs.append(replace(run, frames=replace(run.frames, keyframes=keyframes)))
        images.update({number + offset: image for number, image in saved.images.items()})
    return replace(files[0], contents=contents, runs=tuple(runs), images=images, source="")


def _shifted(ids: IntArray, offset: int) -> IntArray:
    return np.where(ids >= 0, ids + offset, ids)


def _joined(parts: Sequence[MapContents]) -> MapContents:
    keyframe = np.cumsum([0, *(part.next_keyframe for part in parts)])
    point = np.cumsum([0, *(part.next_point for part in parts)])
    camera = np.cumsum([0, *(len(part.cameras) for part in parts)])

    def together(
        kind: type[Any], group: Callable[[MapContents], ArrayGroup], **shifts: NDArray[np.int64]
    ) -> Any:
        """Join the arrays of one group; ids are shifted."""
        columns: dict[str, list[NDArray[Any]]] = {}
        for number, part in enumerate(parts):
            for name, array in group(part).arrays():
                by = shifts.get(name)
                shifted = array if by is None else _shifted(array, int(by[number]))
                columns.setdefault(name, []).append(shifted)
        return kind(**{name: np.concatenate(arrays) for name, arrays in columns.items()})

    def keyframes_of(part: MapContents) -> Keyframes:
        return _complete(part.keyframes, [other.keyframes for other in parts])

    keyframes = together(Keyframes, keyframes_of, ids=keyframe, parent=keyframe, camera=camera)
    counts = [np.diff(part.keyframes.offsets) for part in parts]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int64)
    states = together(ImuStates, lambda part: part.imu_states, ids=keyframe)
    n_samples = np.concatenate([np.diff(part.imu_states.offsets) for part in parts])
    samples_end = np.concatenate([[0], np.cumsum(n_samples)]).astype(np.int64)
    return replace(
        parts[0],
        map_index=0,
        next_keyframe=int(keyframe[-1]),
        next_point=int(point[-1]),
        cameras=together(Cameras, lambda part: part.cameras),
        keyframes=replace(keyframes, offsets=offsets),
        removed_keyframes=together(
            RemovedKeyframes, lambda part: part.removed_keyframes, ids=keyframe, parent=keyframe
        ),
        points=together(
            Points,
            lambda part: part.points,
            ids=point,
            reference_keyframe=keyframe,
            first_keyframe=keyframe,
        ),
        observations=together(
            Observations, lambda part: part.observations, point=point, keyframe=keyframe
        ),
        covisibility=together(Covisibility, lambda part: part.covisibility, a=keyframe, b=keyframe),
        loop_edges=np.concatenate(
            [part.loop_edges + by for part, by in zip(parts, keyframe[:-1], strict=True)]
        ),
        metric_roots=tuple(
            root + by
            for part, by in zip(parts, keyframe[:-1].tolist(), strict=True)
            for root in part.metric_roots
        ),
        upright_roots=tuple(
            root + by
            for part, by in zip(parts, keyframe[:-1].tolist(), strict=True)
            for root in part.upright_roots
        ),
        imu_states=replace(states, offsets=samples_end),
        patches=together(
            Patches, lambda part: part.patches, point=point, keyframe=keyframe, camera=camera
        ),
        aligned=together(
            AlignedSightings, lambda part: part.aligned, point=point, keyframe=keyframe
        ),
        alignment_noise=_noise_of_all(parts),
    )


def _noise_of_all(parts: Sequence[MapContents]) -> FloatArray:
    """That of the map which measured it most often: a system has one for all its maps."""
    return max((part.alignment_noise for part in parts), key=lambda noise: noise[:, 1].sum())


def _complete(keyframes: Keyframes, all_of_them: Sequence[Keyframes]) -> Keyframes:
    """Add optional arrays that no keyframe of this map has, if another map has them."""
    n = int(keyframes.offsets[-1])
    raw, colours, words = keyframes.raw_keypoints, keyframes.colours, keyframes.words
    if not len(raw) and any(len(other.raw_keypoints) for other in all_of_them):
        raw = keyframes.keypoints
    if not len(colours) and any(len(other.colours) for other in all_of_them):
        colours = np.zeros((n, 3), np.uint8)
    if not all(len(other.words) for other in all_of_them):
        words = np.zeros(0, np.uint32)
    return replace(keyframes, raw_keypoints=raw, colours=colours, words=words)
