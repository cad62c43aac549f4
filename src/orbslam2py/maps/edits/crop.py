# SPDX-License-Identifier: BSD-3-Clause
"""A part of a map: some keyframes, their observations, and a spanning tree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import array_of, is_number, shown
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.content_groups import (
    AlignedSightings,
    Covisibility,
    Keyframes,
    Observations,
    Patches,
    RemovedKeyframes,
)
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.edits.spanning_tree import (
    count_covisibility,
    map_numbers,
    spanning_parents,
)
from orbslam2py.maps.imu_states import states_of_part

BoolArray = NDArray[np.bool_]

#: A point that loses an observation is dropped with so much weight or less (2 with depth, 1 else),
#: as in `erase_observation` of ``src/cpp/map/map_points.cpp``.
_DYING_COUNT = 2


def crop_to_times(contents: MapContents, begin: float, end: float) -> MapContents:
    """Keep the keyframes of a time interval, and their observations (`keep_keyframes`).

    Parameters
    ----------
    contents
        The map.
    begin, end
        Time stamps [s], both included; they may be infinite.

    Raises
    ------
    MapFileError
        If no keyframe is left, or an argument is invalid.
    """
    return keep_keyframes(contents, keyframes_of_times(contents, begin, end))


def keyframes_of_times(contents: MapContents, begin: float, end: float) -> BoolArray:
    """Return which keyframes, bool (k,), are in a time interval; see `crop_to_times`."""
    times = contents_of(contents).keyframes.timestamps
    begin, end = _seconds(begin, "begin"), _seconds(end, "end")
    kept = (times >= begin) & (times <= end)
    if not kept.any():
        first, last = times.min(initial=np.inf), times.max(initial=-np.inf)
        raise MapFileError(
            f"nothing of the map is left: no keyframe is of {begin:.6f} to {end:.6f} s; they are "
            f"of {first:.6f} to {last:.6f} s"
        )
    return np.asarray(kept)


def crop_to_box(
    contents: MapContents, low: FloatArray, high: FloatArray, *, points_too: bool = False
) -> MapContents:
    """Keep the keyframes whose cameras are in a box, and their observations (`keep_keyframes`).

    Parameters
    ----------
    contents
        The map.
    low, high
        Corners (3,) of the box in the map's world, both included. With several maps, in the world
        of each.
    points_too
        Also drop points outside the box.

    Raises
    ------
    MapFileError
        If no keyframe is left, or an argument is invalid.
    """
    kept = keyframes_in_box(contents, low, high)
    points = inside_box(contents.points.positions, low, high) if points_too else None
    return keep_keyframes(contents, kept, points)


def keyframes_in_box(contents: MapContents, low: FloatArray, high: FloatArray) -> BoolArray:
    """Return which keyframes, bool (k,), are in a box; see `crop_to_box`."""
    centres = contents_of(contents).keyframes.T_wc[:, :3, 3]
    kept = inside_box(centres, low, high)
    if not kept.any():
        raise MapFileError(
            f"nothing of the map is left: no camera stood in the box from {_corner(low)} to "
            f"{_corner(high)}; they stood in {_corner(centres.min(axis=0))} to "
            f"{_corner(centres.max(axis=0))}"
        )
    return kept


def inside_box(positions: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Return which positions (n, 3) are in a box or on its faces; bool (n,)."""
    low = array_of(low, "the low corner", (3,), MapFileError, finite=False)
    high = array_of(high, "the high corner", (3,), MapFileError, finite=False)
    return np.asarray(np.all((positions >= low) & (positions <= high), axis=1))


def keep_keyframes(
    contents: MapContents, kept: BoolArray, kept_points: BoolArray | None = None
) -> MapContents:
    """Keep some keyframes of a map, and their observations.

    Points follow the rule of the map: a point that has lost an observation is kept if it has more
    than one observation with depth, or more than two without. Connections are counted again. A
    keyframe without parent gets its strongest neighbour as parent. If keyframe 0 is removed, the
    first remaining keyframe gets its number, because it becomes the root. The world stays.

    Several maps stay separate: if the root of one is removed, its first remaining keyframe becomes
    the root.

    Parameters
    ----------
    contents
        The map.
    kept
        Mask of the keyframes, bool (k,), at least one of them true.
    kept_points
        Mask of the points that may be kept, bool (p,); all of them by default.

    Returns
    -------
    MapContents
        A map that fulfils all invariants if `contents` does.

    Raises
    ------
    MapFileError
        If no keyframe is kept, or an argument is invalid.
    """
    contents_of(contents)
    kept = _mask(kept, "kept", len(contents.keyframes), "keyframe")
    if not kept.any():
        raise MapFileError("nothing of the map is left; keep at least one keyframe")
    n = len(contents.points)
    stay = (
        np.ones(n, bool) if kept_points is None else _mask(kept_points, "kept_points", n, "point")
    )
    sightings = _surviving_observations(contents, kept, stay)
    observations = Observations(
        contents.observations.point[sightings],
        contents.observations.keyframe[sightings],
        contents.observations.keypoint[sightings],
    )
    keyframes = _select(contents.keyframes, kept)
    covisibility = count_covisibility(observations, keyframes.ids)
    numbers = map_numbers(contents.keyframes)
    maps = numbers[kept]
    parents, provisional = spanning_parents(keyframes, covisibility, maps)

    def roots_now(roots: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(
            sorted(
                int(keyframes.ids[maps == number][0])
                for number in numbers[np.isin(contents.keyframes.ids, roots)]
                if (maps == number).any()
            )
        )

    cropped = replace(
        contents,
        keyframes=replace(keyframes, parent=parents, provisional_parent=provisional),
        removed_keyframes=_still_hanging(contents.removed_keyframes, keyframes.ids),
        observations=observations,
        covisibility=covisibility,
        loop_edges=contents.loop_edges[np.isin(contents.loop_edges, keyframes.ids).all(axis=1)],
        metric_roots=roots_now(contents.metric_roots),
        upright_roots=roots_now(contents.upright_roots),
        imu_states=states_of_part(contents.imu_states, keyframes),
    )
    cropped = _select_points(cropped, np.isin(contents.points.ids, observations.point))
    cropped = _select_alignment(cropped)
    root = int(keyframes.ids[0])
    return cropped if root == 0 else _renumbered(cropped, root)


def _mask(value: Any, what: str, n: int, noun: str) -> BoolArray:
    """Take a mask of `n` values; refuse whole numbers, which would count as indices."""
    remedy = f"give a bool array of shape ({n},), True for each {noun} that stays"
    try:
        mask = np.asarray(value)
    except ValueError:  # lists of lists of different lengths
        raise MapFileError(f"{what} is {shown(value)}; {remedy}") from None
    if mask.dtype != bool or mask.shape != (n,):
        raise MapFileError(f"{what} is of {mask.dtype} and shape {mask.shape}; {remedy}")
    return mask


def _seconds(value: Any, what: str) -> float:
    if not is_number(value) or np.isnan(value):
        raise MapFileError(f"{what} is {shown(value)}; give a time stamp in seconds")
    return float(value)


def _surviving_observations(
    contents: MapContents, kept: BoolArray, kept_points: BoolArray
) -> BoolArray:
    """Return which observations (o,) stay: of kept keyframes and of points that remain."""
    observations, keyframes = contents.observations, contents.keyframes
    there = kept[np.searchsorted(keyframes.ids, observations.keyframe)]
    row = np.searchsorted(contents.points.ids, observations.point)
    weight = np.where(keyframes.depth[contents.observed_keypoints] > 0, 2, 1)
    n = len(contents.points)
    left = np.bincount(row[there], weight[there], n)
    lost = np.bincount(row[~there], minlength=n) > 0
    lives = kept_points & (left > np.where(lost, _DYING_COUNT, 0))
    return np.asarray(there & lives[row])


def _select(keyframes: Keyframes, kept: BoolArray) -> Keyframes:
    counts = np.diff(keyframes.offsets)
    keypoints = np.repeat(kept, counts)
    arrays: dict[str, NDArray[Any]] = {}
    for name, array in keyframes.arrays():
        if name == "offsets":
            arrays[name] = np.concatenate([[0], np.cumsum(counts[kept])]).astype(np.int64)
        elif name in _OF_KEYPOINTS:
            arrays[name] = array[keypoints] if len(array) else array
        else:
            arrays[name] = array[kept]
    return Keyframes(**arrays)


_OF_KEYPOINTS = {
    *("keypoints", "raw_keypoints", "octave", "angle", "response", "descriptors", "depth"),
    *("right_u", "colours", "words"),
}


def _still_hanging(removed: RemovedKeyframes, living: IntArray) -> RemovedKeyframes:
    """Return the removed keyframes that refer, directly or not, to a kept keyframe."""
    reached = np.isin(removed.parent, living)
    while True:
        more = reached | np.isin(removed.parent, removed.ids[reached])
        if (more == reached).all():
            break
        reached = more
    return RemovedKeyframes(**{name: array[reached] for name, array in removed.arrays()})


def _select_points(contents: MapContents, kept: BoolArray) -> MapContents:
    """Drop points; replace removed reference keyframes by the first observing ones."""
    observations = contents.observations
    points = replace(
        contents.points, **{name: array[kept] for name, array in contents.points.arrays()}
    )
    first = observations.keyframe[np.searchsorted(observations.point, points.ids)]
    referred = np.isin(points.reference_keyframe, contents.keyframes.ids)
    reference = np.where(referred, points.reference_keyframe, first)
    points = replace(points, reference_keyframe=reference)
    return refresh_distances(replace(contents, points=points), ~referred)


def _select_alignment(contents: MapContents) -> MapContents:
    """Drop patches without their point or the pose of their keyframe, and what they served."""
    patches, aligned, seen = contents.patches, contents.aligned, contents.observations
    known = np.concatenate([contents.keyframes.ids, contents.removed_keyframes.ids])
    stay = np.isin(patches.point, contents.points.ids) & np.isin(patches.keyframe, known)
    patches = Patches(**{name: array[stay] for name, array in patches.arrays()})
    # One keyframe has not more than 2^20 keypoints.
    there = seen.keyframe * 2**20 + seen.keypoint
    counts = np.isin(aligned.keyframe * 2**20 + aligned.keypoint, there)
    counts &= np.isin(aligned.point, patches.point)
    aligned = AlignedSightings(**{name: array[counts] for name, array in aligned.arrays()})
    return replace(contents, patches=patches, aligned=aligned)


def refresh_distances(contents: MapContents, which: BoolArray) -> MapContents:
    """Compute the range of distances of some points again, from their reference keyframes.

    Raul Mur-Artal et al., "ORB-SLAM", 2015, section III-C; ``docs/method/map.md#map-points``.

    Parameters
    ----------
    contents
        The map.
    which
        Which points, bool (p,).
    """
    points, keyframes, observations = contents.points, contents.keyframes, contents.observations
    if not which.any():
        return contents
    row = np.searchsorted(points.ids, observations.point)
    seen = np.flatnonzero(which[row] & (observations.keyframe == points.reference_keyframe[row]))
    row = row[seen]
    seer = np.searchsorted(keyframes.ids, observations.keyframe[seen])
    distance = np.linalg.norm(points.positions[row] - keyframes.T_wc[seer, :3, 3], axis=1)
    camera = keyframes.camera[seer]
    factor = contents.cameras.scale_factor[camera].astype(np.float64)
    level = keyframes.octave[contents.observed_keypoints[seen]]
    farthest, nearest = points.max_distance.copy(), points.min_distance.copy()
    farthest[row] = distance * factor**level
    nearest[row] = farthest[row] / factor ** (contents.cameras.n_levels[camera] - 1)
    return replace(contents, points=replace(points, min_distance=nearest, max_distance=farthest))


def _renumbered(contents: MapContents, root: int) -> MapContents:
    """Give the keyframe with the lowest id the number 0 of the root."""

    def new(ids: IntArray) -> IntArray:
        return np.where(ids == root, 0, ids)

    keyframes, points, edges = contents.keyframes, contents.points, contents.covisibility
    # Points that the old keyframe 0 made were not made by the new one.
    reference = new(points.reference_keyframe)
    made_by_old = points.first_keyframe == 0
    states = contents.imu_states
    return replace(
        contents,
        imu_states=replace(states, ids=new(states.ids)),
        patches=replace(contents.patches, keyframe=new(contents.patches.keyframe)),
        aligned=replace(contents.aligned, keyframe=new(contents.aligned.keyframe)),
        keyframes=replace(keyframes, ids=new(keyframes.ids), parent=new(keyframes.parent)),
        removed_keyframes=replace(
            contents.removed_keyframes, parent=new(contents.removed_keyframes.parent)
        ),
        points=replace(
            points,
            reference_keyframe=reference,
            first_keyframe=np.where(made_by_old, reference, new(points.first_keyframe)),
        ),
        observations=replace(contents.observations, keyframe=new(contents.observations.keyframe)),
        covisibility=Covisibility(new(edges.a), new(edges.b), edges.weight),
        loop_edges=new(contents.loop_edges),
        metric_roots=tuple(new(np.array(contents.metric_roots, np.int64)).tolist()),
        upright_roots=tuple(new(np.array(contents.upright_roots, np.int64)).tolist()),
    )


def _corner(position: FloatArray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in position) + ")"
