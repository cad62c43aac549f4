# SPDX-License-Identifier: BSD-3-Clause
"""A map moved into another world: rotated, translated, and scaled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py._arguments import instance_of
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.units import sees_metres
from orbslam2py.trajectory import Similarity
from orbslam2py.trajectory.rotations import inverse_poses

#: Sine of the angle by which the third axis may turn in a map that stays upright: rounding.
_LEANS = 1e-9


def transform_map(
    contents: MapContents, similarity: Similarity, *, metric: bool = False
) -> MapContents:
    """Transform a whole map, with all its lengths and directions.

    A scale other than 1 also changes depths, scale ranges of points, baselines of cameras, and the
    scale of frames relative to keyframes (`Keyframes.scale`). Pixels do not change, nor do
    velocities of an IMU in the axes of their cameras, whose lengths follow `Keyframes.scale`.

    Parameters
    ----------
    contents
        The map.
    similarity
        From the map's world to the new one. A map in metres (stereo, RGB-D) remains consistent with
        its camera only with a scale of 1.
    metric
        Lengths in the new world are metres; the map of a single camera stores this
        (`MapContents.metric_roots`). Otherwise another scale is another unit.

    Returns
    -------
    MapContents
        The same map in the new world; the inverse of `similarity` restores it up to rounding.

    Raises
    ------
    MapFileError
        If an argument is invalid.
    """
    contents_of(contents)
    instance_of(similarity, Similarity, "the similarity", "a Similarity(scale, R, t)", MapFileError)
    keyframes, points, cameras = contents.keyframes, contents.points, contents.cameras
    scale = similarity.scale
    moved = keyframes.with_poses(inverse_poses(similarity.apply_to_poses(keyframes.T_wc)))
    known = keyframes.depth > 0
    depth = np.where(known, scale * keyframes.depth, keyframes.depth).astype(np.float32)
    return replace(
        contents,
        metric_roots=_metric_roots(contents, scale, metric=metric),
        upright_roots=contents.upright_roots if _stays_upright(similarity) else (),
        cameras=cameras.scaled(scale),
        keyframes=replace(moved, depth=depth, scale=scale * keyframes.scale),
        points=replace(
            points,
            positions=similarity.apply(points.positions),
            mean_directions=points.mean_directions @ similarity.R.T,
            min_distance=scale * points.min_distance,
            max_distance=scale * points.max_distance,
        ),
    )


def _stays_upright(similarity: Similarity) -> bool:
    """Whether only yaw and translation change."""
    return similarity.scale == 1 and float(np.abs(similarity.R[:2, 2]).max()) < _LEANS


def _metric_roots(contents: MapContents, scale: float, *, metric: bool) -> tuple[int, ...]:
    if metric and not sees_metres(contents):
        keyframes = contents.keyframes
        return tuple(keyframes.ids[keyframes.parent < 0].tolist())
    return contents.metric_roots if scale == 1 else ()
