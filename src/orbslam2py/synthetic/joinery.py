# SPDX-License-Identifier: BSD-3-Clause
"""Worlds of few parts: a table top, a wall, a lift door; and the camera paths in front of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray

_FLOOR_TEXEL, _WALL_TEXEL, _TABLE_TEXEL = 0.006, 0.003, 0.0018  # metres


@dataclass(frozen=True)
class MovingPart:
    """A piece of a world that slides.

    Attributes
    ----------
    make_world
        Makes it from a seed, at its initial position.
    shift
        Its displacement in the world [m], (3,), at a time [s].
    """

    make_world: Callable[[int], core.World]
    shift: Callable[[float], FloatArray]


def _rectangle(
    corner: Sequence[float], u: Sequence[float], v: Sequence[float], texel: float, texture: int
) -> core.Rectangle:
    """A textured rectangle from a corner and its two edges [m]."""
    rectangle = core.Rectangle()
    rectangle.origin = np.asarray(corner, np.float64)
    rectangle.width, rectangle.height = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    rectangle.u_axis = np.asarray(u, np.float64) / rectangle.width
    rectangle.v_axis = np.asarray(v, np.float64) / rectangle.height
    rectangle.texel = texel
    rectangle.texture = texture
    return rectangle


def _textures(seed: int, kind: int, n: int) -> list[int]:
    return [int(x) for x in np.random.default_rng([seed, kind]).integers(1, 2**62, n)]


# ---- worlds; axes: x right, y down, z forward ----------------------------------------------------
_TABLE_BELOW = 0.65  # the camera's usual height above the table top
_FLOOR_BELOW = 1.4


def make_table_top(seed: int) -> core.World:
    """A table of 1.6 x 1.2 m with seven low things on it, above a floor of 16 x 16 m."""
    textures = iter(_textures(seed, 1, 40))
    pieces = [
        _rectangle([-8, _FLOOR_BELOW, -8], [16, 0, 0], [0, 0, 16], _FLOOR_TEXEL, next(textures)),
        _rectangle(
            [-0.8, _TABLE_BELOW, -0.6], [1.6, 0, 0], [0, 0, 1.2], _TABLE_TEXEL, next(textures)
        ),
    ]
    random = np.random.default_rng([seed, 2])
    for place in range(7):
        angle = 2 * math.pi * (place + random.uniform(-0.2, 0.2)) / 7
        centre = np.array([0.45 * math.sin(angle), 0.33 * math.cos(angle)])
        breadth, length = random.uniform(0.06, 0.2, 2)
        top = _TABLE_BELOW - random.uniform(0.01, 0.08)
        x, z = centre[0] - breadth / 2, centre[1] - length / 2
        pieces.append(
            _rectangle([x, top, z], [breadth, 0, 0], [0, 0, length], _TABLE_TEXEL, next(textures))
        )
        down = [0, _TABLE_BELOW - top, 0]
        for corner, edge in (
            ([x, top, z], [breadth, 0, 0]),
            ([x, top, z + length], [breadth, 0, 0]),
            ([x, top, z], [0, 0, length]),
            ([x + breadth, top, z], [0, 0, length]),
        ):
            pieces.append(_rectangle(corner, edge, down, _TABLE_TEXEL, next(textures)))
    return core.World(pieces)


_WALL_AHEAD = 1.6


def make_wall(seed: int) -> core.World:
    """One wall of 16 x 8 m, and nothing else."""
    (texture,) = _textures(seed, 3, 1)
    return core.World(
        [_rectangle([-8, -4, _WALL_AHEAD], [16, 0, 0], [0, 8, 0], _WALL_TEXEL, texture)]
    )


_DOOR_HALF, _DOOR_TOP, _DOOR_BOTTOM = 0.6, -1.0, 1.3
_CABIN_DEEP = 1.5
_DOOR_PERIOD, _DOOR_SLIDES = 8.0, 1.5  # seconds


def make_lift(seed: int) -> core.World:
    """A wall with the opening of a lift and its cabin; the door is a separate part."""
    textures = iter(_textures(seed, 4, 12))
    x, top, bottom, z = _DOOR_HALF, _DOOR_TOP, _DOOR_BOTTOM, _WALL_AHEAD
    back = z + _CABIN_DEEP
    deep: list[float] = [0, 0, _CABIN_DEEP]
    across: list[float] = [2 * x, 0, 0]
    tall: list[float] = [0, bottom - top, 0]
    pieces: list[tuple[list[float], list[float], list[float]]] = [
        ([-6, -5, z], [6 - x, 0, 0], [0, 10, 0]),
        ([x, -5, z], [6 - x, 0, 0], [0, 10, 0]),
        ([-x, -5, z], across, [0, top + 5, 0]),
        ([-x, bottom, z], across, [0, 5 - bottom, 0]),
        ([-x, top, back], across, tall),
        ([-x, top, z], deep, tall),
        ([x, top, z], deep, tall),
        ([-x, top, z], across, deep),
        ([-x, bottom, z], across, deep),
    ]
    return core.World([_rectangle(*piece, _WALL_TEXEL, next(textures)) for piece in pieces])


def lift_door() -> tuple[MovingPart, ...]:
    """Both halves of the door; it opens and closes every eight seconds, first after two."""
    return (_half_door(-1), _half_door(1))


def _half_door(side: int) -> MovingPart:
    left = -_DOOR_HALF if side < 0 else 0.0

    def make(seed: int) -> core.World:
        texture = _textures(seed, 5, 2)[side > 0]
        height = [0, _DOOR_BOTTOM - _DOOR_TOP, 0]
        # A little behind the wall's front: it slides into the wall.
        corner = [left, _DOOR_TOP, _WALL_AHEAD + 0.08]
        return core.World([_rectangle(corner, [_DOOR_HALF, 0, 0], height, _WALL_TEXEL, texture)])

    def shift(seconds: float) -> FloatArray:
        return np.array([side * _DOOR_HALF * _door_open(seconds), 0.0, 0.0])

    return MovingPart(make, shift)


def _door_open(seconds: float) -> float:
    """From 0, closed, to 1, open."""
    phase = (seconds - 2.0) % _DOOR_PERIOD if seconds > 2.0 else 0.0
    opening = min(1.0, phase / _DOOR_SLIDES)
    shutting = min(1.0, max(0.0, phase - _DOOR_PERIOD / 2) / _DOOR_SLIDES)
    return opening - shutting


# ---- ways: camera to world (4, 4) at a time [s] --------------------------------------------------
def over_the_table(seconds: float) -> FloatArray:
    """A circle above the table in 15 s, looking at its centre from 55 degrees."""
    phase = 2 * math.pi * seconds / 15.0
    radius = 0.38 + 0.08 * math.sin(2 * phase)
    position = [radius * math.sin(phase), 0.08 * math.sin(1.5 * phase), -radius * math.cos(phase)]
    target = np.array([0.05 * math.sin(3 * phase), _TABLE_BELOW, 0.05 * math.cos(2 * phase)])
    return _looking_at(np.array(position), target)


def along_the_wall(seconds: float) -> FloatArray:
    """Back and forth over 6 m in 24 s, 1.3 to 1.9 m from the wall, nearly perpendicular to it."""
    phase = 2 * math.pi * seconds / 24.0
    T_wc = _rotated(0.04 * math.sin(1.7 * phase), 0.15 * math.sin(3 * phase), 0.0)
    T_wc[:3, 3] = [3 * math.sin(phase), 0.15 * math.sin(4 * phase), 0.3 * math.sin(2 * phase)]
    return T_wc


def before_the_door(seconds: float) -> FloatArray:
    """Waiting: swaying by 25 cm sideways in 6 s, and by 15 cm forwards."""
    phase = 2 * math.pi * seconds / 6.0
    T_wc = _rotated(0.03 * math.sin(1.3 * phase), 0.08 * math.sin(phase), 0.0)
    T_wc[:3, 3] = [0.25 * math.sin(phase), 0.05 * math.sin(2.2 * phase), 0.15 * math.sin(phase / 2)]
    return T_wc


def _rotated(pitch: float, yaw: float, roll: float) -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array([pitch, yaw, roll]))[0]
    return T


def _looking_at(position: FloatArray, target: FloatArray) -> FloatArray:
    """Pose of an upright camera (y down) at a position that looks at a target."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    T_wc = np.eye(4)
    T_wc[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T_wc[:3, 3] = position
    return T_wc
