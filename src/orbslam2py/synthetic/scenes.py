# SPDX-License-Identifier: BSD-3-Clause
"""The synthetic worlds and the camera's path in each."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.synthetic import joinery
from orbslam2py.synthetic.joinery import MovingPart


class SyntheticWorld(str, Enum):
    """The available worlds, with the path of the camera in each."""

    ROOM = "room"
    """A room of 6 x 6 m; the camera turns in its centre, once in 30 s."""
    CORRIDOR = "corridor"
    """A corridor around a block; a little more than one lap (26 m)."""
    REPEATING_CORRIDOR = "repeating-corridor"
    """The same, but the pictures on its walls repeat every four metres."""
    FIGURE_EIGHT = "figure-eight"
    """Two corridors with a common part; a little more than two loops."""
    STREET = "street"
    """A drive along a straight street, of 600 m or up to 3500 m."""
    STREET_LAP = "street-lap"
    """A drive around a block of houses; a little more than one lap (600 m)."""
    TWO_ROOMS = "two-rooms"
    """From a room through a door and a passage into an identical room."""
    STREET_BLOCK = "street-block"
    """A drive around a smaller block of houses; a little more than one lap (320 m)."""
    TABLE_TOP = "table-top"
    """A circle above a table with low objects on it, looking down."""
    WALL = "wall"
    """Back and forth along a wall that fills the view."""
    LIFT_DOOR = "lift-door"
    """Waiting in front of a lift whose door opens and closes."""

    def __str__(self) -> str:
        return self.value


class Corners(str, Enum):
    """How the viewing direction follows the bends of a path."""

    ROUND = "round"
    """It begins to turn before a bend: the turn rate is continuous."""
    SHARP = "sharp"
    """It turns with the path: suddenly, by 4 degrees a frame in streets."""

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Scene:
    """A world and the camera's path in it.

    Attributes
    ----------
    make_world
        Makes the world from a seed.
    way
        Path along corridors and streets; None if there is none.
    looking
        Without a path: the pose, camera to world (4, 4), at a time [s].
    period
        Usual duration in seconds.
    speed
        Usual speed [m/s].
    outdoors
        Open above; seen from a car.
    moving
        Moving parts of the world.
    """

    make_world: Callable[[int], core.World]
    way: core.Way | None
    looking: Callable[[float], FloatArray] | None = None
    period: float = 0.0
    speed: float = 0.7
    outdoors: bool = False
    moving: tuple[MovingPart, ...] = ()

    def seconds(self, speed: float, laps: float) -> float:
        """Return the time [s] of `laps` rounds of the path at a speed [m/s].

        Without a path it is the world's own time.
        """
        return self.period if self.way is None else laps * self.way.length() / speed

    def T_wc(
        self, seconds: float, speed: float, lateral: float, yaw: float, *, sharp: bool = False
    ) -> FloatArray:
        """Camera to world (4, 4) at a time.

        Parameters
        ----------
        seconds
            Since the start.
        speed
            Metres per second.
        lateral
            Offset to the right of the path [m].
        yaw
            Radians to the right of the direction of travel.
        sharp
            Whether the viewing direction turns with the path, without smoothing.
        """
        if self.way is not None:
            # A car rolls gently where a walker sways at every step.
            sway, stride = (0.05, 40.0) if self.outdoors else (0.08, 1.7)
            T_wc = np.asarray(self.way.T_wc(speed * seconds, lateral, yaw, sway, stride))
            return _turned_at_once(self.way, speed * seconds, T_wc) if sharp else T_wc
        assert self.looking is not None
        T_wc = self.looking(seconds)
        aside = np.eye(4)
        aside[0, 3] = lateral
        aside[0, [0, 2]] = math.cos(yaw), math.sin(yaw)
        aside[2, [0, 2]] = -math.sin(yaw), math.cos(yaw)
        return np.asarray(T_wc @ aside)


def _turned_at_once(way: core.Way, distance: float, T_wc: FloatArray) -> FloatArray:
    """Return a pose on a path, rotated from the smoothed heading to the path's own."""
    around = 1e-4  # metres
    before, here, after = (way.T_wc(distance + s, sway=0.0) for s in (-around, 0.0, around))
    step = after[:3, 3] - before[:3, 3]
    turn = math.atan2(step[0], step[2]) - math.atan2(here[0, 2], here[2, 2])
    about = np.eye(4)
    about[0, [0, 2]] = math.cos(turn), math.sin(turn)
    about[2, [0, 2]] = -math.sin(turn), math.cos(turn)
    about[:3, 3] = here[:3, 3] - about[:3, :3] @ here[:3, 3]
    return np.asarray(about @ T_wc)


# Sizes in metres; length goes along z (forward), breadth along x (right).
_ROOM = (6.0, 3.0, 6.0)  # along x (right), y (down), z (forward)
_LOOKING_AROUND = 15.0  # seconds, for half a turn
_CORRIDOR = {"length": 10.0, "breadth": 8.0, "width": 2.0}  # from outer wall to outer wall
_EIGHT = {"length": 10.0, "breadth": 12.0, "width": 2.0}
_HEIGHT = 2.6  # of corridors
_REPEAT = 4.0  # after which the pictures of the repeating corridor come again
#: Of the straight street.
STREET_LENGTH = 600.0
_STREET_WIDTH = 12.0
_BLOCK = {"length": 208.0, "breadth": 104.0, "width": 14.0}  # between middles of its streets
_SMALL_BLOCK = {"length": 108.0, "breadth": 64.0, "width": 14.0}
_PASSAGE = 3.0  # between the two rooms


#: Metres a camera can be moved to either side of the way without leaving the world.
ROOM_BESIDE = {
    SyntheticWorld.ROOM: 1.5,
    SyntheticWorld.CORRIDOR: 0.8,
    SyntheticWorld.REPEATING_CORRIDOR: 0.8,
    SyntheticWorld.FIGURE_EIGHT: 0.8,
    SyntheticWorld.STREET: 3.5,
    SyntheticWorld.STREET_LAP: 3.0,
    SyntheticWorld.TWO_ROOMS: 0.6,
    SyntheticWorld.STREET_BLOCK: 3.0,
    SyntheticWorld.TABLE_TOP: 0.3,
    SyntheticWorld.WALL: 1.0,
    SyntheticWorld.LIFT_DOOR: 0.5,
}

#: How often the way is usually gone, for those that come back to their start.
LAPS = {
    SyntheticWorld.CORRIDOR: 1.2,
    SyntheticWorld.REPEATING_CORRIDOR: 1.2,
    SyntheticWorld.FIGURE_EIGHT: 1.1,
    SyntheticWorld.STREET_LAP: 1.2,
    SyntheticWorld.STREET_BLOCK: 1.2,
}

#: Ways that turn corners.
CORNERED = (*LAPS, SyntheticWorld.TWO_ROOMS)

#: Worlds without a way: there is no speed in metres per second.
WITHOUT_WAY = {
    SyntheticWorld.ROOM: "one turn takes 30 s",
    SyntheticWorld.TABLE_TOP: "once around takes 15 s",
    SyntheticWorld.WALL: "to and fro takes 24 s",
    SyntheticWorld.LIFT_DOOR: "the camera waits",
}


def make_scene(world: SyntheticWorld, length: float | None = None) -> Scene:
    """Choose the world and the path; the world is made later, when the seed is known.

    Parameters
    ----------
    world
        Which one.
    length
        Metres of the straight street.
    """
    if world in WITHOUT_WAY:
        return _scene_without_way(world)
    if world in (SyntheticWorld.CORRIDOR, SyntheticWorld.REPEATING_CORRIDOR):
        repeat = _REPEAT if world is SyntheticWorld.REPEATING_CORRIDOR else 0.0
        return Scene(
            lambda seed: core.make_corridor(**_CORRIDOR, height=_HEIGHT, seed=seed, repeat=repeat),
            core.corridor_way(**_CORRIDOR),
        )
    if world is SyntheticWorld.FIGURE_EIGHT:
        return Scene(
            lambda seed: core.make_figure_eight(**_EIGHT, height=_HEIGHT, seed=seed),
            core.figure_eight_way(**_EIGHT),
        )
    if world is SyntheticWorld.TWO_ROOMS:
        return Scene(
            lambda seed: core.make_two_rooms(_ROOM, _PASSAGE, seed, n_boxes=8),
            core.two_rooms_way(_ROOM, _PASSAGE),
            speed=0.4,
        )
    if world in (SyntheticWorld.STREET_LAP, SyntheticWorld.STREET_BLOCK):
        block = _BLOCK if world is SyntheticWorld.STREET_LAP else _SMALL_BLOCK
        return Scene(
            lambda seed: core.make_street_lap(**block, seed=seed),
            core.street_lap_way(**block),
            speed=10.0,
            outdoors=True,
        )
    return Scene(
        lambda seed: core.make_street(length or STREET_LENGTH, _STREET_WIDTH, seed),
        core.street_way(length or STREET_LENGTH),
        speed=10.0,
        outdoors=True,
    )


def _scene_without_way(world: SyntheticWorld) -> Scene:
    if world is SyntheticWorld.TABLE_TOP:
        return Scene(joinery.make_table_top, None, joinery.over_the_table, period=17.0)
    if world is SyntheticWorld.WALL:
        return Scene(joinery.make_wall, None, joinery.along_the_wall, period=24.0)
    if world is SyntheticWorld.LIFT_DOOR:
        door = joinery.lift_door()
        return Scene(joinery.make_lift, None, joinery.before_the_door, period=16.0, moving=door)

    def look_around(seconds: float) -> FloatArray:
        return np.asarray(core.room_T_wc(_ROOM, seconds, 2 * _LOOKING_AROUND))

    make_room = functools.partial(core.make_room, _ROOM, n_boxes=10)
    return Scene(lambda seed: make_room(seed=seed), None, look_around, period=_LOOKING_AROUND)
