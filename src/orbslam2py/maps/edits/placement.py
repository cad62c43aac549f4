# SPDX-License-Identifier: BSD-3-Clause
"""Alignment of a map with another world: by a true trajectory, by points, or by a length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arguments import array_of, instance_of, number_above_zero
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.units import sees_metres
from orbslam2py.trajectory import MAX_DIFFERENCE, Similarity, Trajectory, align, associate

#: Least number of positions that determine the pose of a map.
_FEWEST = 3

#: Positions count as collinear if their spread across the line is below this part of that along it.
_THIN = 1e-3

#: Positions that are nearer than this are one.
_SAME_PLACE = 1e-9

#: Nothing is farther away than this [m], more than twice as far as the moon: such a number is a
#: slip, and those of much larger ones overflow further on.
FARTHEST = 1e9


@dataclass(frozen=True, eq=False)
class Placement:
    """The transform of a map into another world; ``transform_map(..., metric=True)`` applies it.

    Attributes
    ----------
    similarity
        From the map's world to the other; its scale is 1 for a map in metres.
    n_pairs
        Number of positions that determined it.
    rmse
        RMS of the remaining distances [m]; 0 if a length alone determined it.
    on_a_line
        The positions are on a line: the rotation about it is not known, and the smallest is used.
    """

    similarity: Similarity
    n_pairs: int
    rmse: float
    on_a_line: bool


def place_by_trajectory(
    contents: MapContents, truth: Trajectory, *, max_difference: float = MAX_DIFFERENCE
) -> Placement:
    """Align the keyframes with the true poses of the same times (Umeyama, PAMI 1991).

    Parameters
    ----------
    contents
        The map; for a single camera its scale is estimated too.
    truth
        Poses of the camera; only positions count.
    max_difference
        Largest difference of matching time stamps [s].

    Raises
    ------
    MapFileError
        If fewer than three keyframes have a true pose at their time, if all are at one position, if
        a position is impossibly far away, or if an argument is invalid.
    """
    keyframes = contents_of(contents).keyframes
    instance_of(truth, Trajectory, "the truth", "an orbslam2py.Trajectory", MapFileError)
    there = truth.select(~truth.lost)
    rows, poses = associate(keyframes.timestamps, there.timestamps, max_difference)
    if len(rows) < _FEWEST:
        raise MapFileError(
            f"only {len(rows)} of {len(keyframes)} keyframes have a true pose within "
            f"{max_difference:g} s, and it takes {_FEWEST}; give the truth of the sequence that "
            "the map was made of"
        )
    # A camera that went straight on has no other path: it is placed, with a warning.
    return _place(contents, keyframes.T_wc[rows, :3, 3], there.positions[poses])


def place_by_points(contents: MapContents, positions: FloatArray, known: FloatArray) -> Placement:
    """Align positions in the map with known positions (Umeyama, PAMI 1991).

    Parameters
    ----------
    contents
        The map; for a single camera its scale is estimated too.
    positions
        Positions in the map's world, (m, 3), at least three.
    known
        The same points in the other world, (m, 3).

    Raises
    ------
    MapFileError
        If there are fewer than three, if all are at one position or on a line, if one is impossibly
        far away, or if they are no such arrays.
    """
    contents_of(contents)
    positions = array_of(positions, "positions", (-1, 3), MapFileError, finite=False)
    known = array_of(known, "known", (-1, 3), MapFileError, finite=False)
    if len(positions) != len(known):
        raise MapFileError(
            f"{len(positions)} positions, but {len(known)} known ones; give one for each"
        )
    if len(positions) < _FEWEST:
        raise MapFileError(
            f"{len(positions)} known points do not determine the pose of the map; give at least "
            f"{_FEWEST}, not on one line"
        )
    placement = _place(contents, positions, known)
    if placement.on_a_line:
        thin = "the map" if _is_thin(_spread(positions)) else "the world"
        raise MapFileError(
            f"the known points lie on a line in {thin}, so the rotation about the line is not "
            "determined; give another one, well beside the line"
        )
    return placement


def _place(contents: MapContents, positions: FloatArray, known: FloatArray) -> Placement:
    """Align positions with known ones; an undetermined rotation is kept small."""
    _check_near(positions)
    _check_near(known)
    spreads = [_spread(places) for places in (positions, known)]
    if min(spread[0] for spread in spreads) < _SAME_PLACE:
        raise MapFileError("the known points are all at one place; give some that are apart")
    on_a_line = any(map(_is_thin, spreads))
    with_scale = not sees_metres(contents)
    similarity = align(positions, known, with_scale=with_scale, on_a_line=on_a_line)
    left = np.linalg.norm(similarity.apply(positions) - known, axis=1)
    return Placement(
        similarity=similarity,
        n_pairs=len(positions),
        rmse=float(np.sqrt(np.mean(left**2))),
        on_a_line=on_a_line,
    )


def place_by_length(
    contents: MapContents, first: FloatArray, second: FloatArray, metres: float
) -> Placement:
    """Set the unit of a single camera's map by the distance between two positions.

    Parameters
    ----------
    contents
        The map.
    first, second
        Positions in the map's world, (3,).
    metres
        Their distance.

    Raises
    ------
    MapFileError
        If the map is already in metres, if both positions are the same, or if the length or a
        position is impossible.
    """
    if sees_metres(contents_of(contents)):
        raise MapFileError(
            "the map has metres already, from the baseline or the depth images; correct these in "
            "the settings if its lengths are wrong"
        )
    ends = [
        array_of(end, f"the {name} position", (3,), MapFileError, finite=False)
        for name, end in (("first", first), ("second", second))
    ]
    metres = number_above_zero(metres, "the length", "metres, above 0", MapFileError)
    if not _SAME_PLACE <= metres <= FARTHEST:
        raise MapFileError(
            f"a length of {metres:g} m cannot be meant; give metres, from {_SAME_PLACE:g} to "
            f"{FARTHEST:g}"
        )
    _check_near(np.stack(ends))
    distance = float(np.linalg.norm(ends[1] - ends[0]))
    if distance < _SAME_PLACE:
        raise MapFileError("both ends of the length are at one place; give two that are apart")
    # Keyframe 0 stays where it is: usually the origin, so that only the size changes.
    scale = metres / distance
    centre = contents.keyframes.T_wc[0, :3, 3]
    return Placement(Similarity(scale, np.eye(3), (1 - scale) * centre), 2, 0.0, on_a_line=False)


def _check_near(positions: FloatArray) -> None:
    """Refuse positions (m, 3) that are impossibly far away."""
    far = np.flatnonzero(~(np.abs(positions) <= FARTHEST).all(axis=1))
    if len(far):
        named = ", ".join(f"{number:g}" for number in positions[far[0]])
        raise MapFileError(
            f"the position {named} cannot be meant; give numbers up to {FARTHEST:g}, such as "
            "1.5, 0, -2"
        )


def _is_thin(spread: FloatArray) -> bool:
    return bool(spread[1] < _THIN * spread[0])


def _spread(positions: FloatArray) -> FloatArray:
    """Standard deviations along the principal axes, descending."""
    centred = positions - positions.mean(axis=0)
    return np.asarray(np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(positions)))
