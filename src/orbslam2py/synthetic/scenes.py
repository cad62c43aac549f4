# SPDX-License-Identifier: BSD-3-Clause
"""The synthetic worlds and the camera's way through each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray


class SyntheticWorld(str, Enum):
    """The worlds there are, with the way the camera takes through them."""

    ROOM = "room"
    """A room of 6 x 6 m; the camera looks around from its middle, once in 30 s."""
    CORRIDOR = "corridor"
    """A corridor around a block; one lap (26 m) and a bit."""
    REPEATING_CORRIDOR = "repeating-corridor"
    """The same, but the pictures on its walls come again every four metres."""
    FIGURE_EIGHT = "figure-eight"
    """Two corridors with a common leg; two loops and a bit."""
    STREET = "street"
    """A drive of 600 m along a straight street."""
    STREET_LAP = "street-lap"
    """A drive around a block of houses; one lap (600 m) and a bit."""
    TWO_ROOMS = "two-rooms"
    """From a room through a door and a passage into a room that looks the same."""

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Scene:
    """A world and the way through it.

    Attributes
    ----------
    make_world
        Makes the world from a seed.
    way
        None stands for looking around in the room.
    speed
        Usual speed [m/s].
    outdoors
        Open above; seen from a car.
    """

    make_world: Callable[[int], core.World]
    way: core.Way | None
    speed: float = 0.7
    outdoors: bool = False

    def seconds(self, speed: float, laps: float) -> float:
        """Return the time [s] that `laps` times the way take at a speed [m/s].

        Looking around in the room takes its own time, whatever is asked for.
        """
        return _LOOKING_AROUND if self.way is None else laps * self.way.length() / speed

    def T_wc(self, seconds: float, speed: float, lateral: float, yaw: float) -> FloatArray:
        """Camera to world (4, 4) at a time.

        Parameters
        ----------
        seconds
            Since the start.
        speed
            Metres per second.
        lateral
            Metres to the right of the way.
        yaw
            Radians to the right of the direction of travel.
        """
        if self.way is not None:
            # A car rolls gently where a walker sways at every step.
            sway, stride = (0.05, 40.0) if self.outdoors else (0.08, 1.7)
            return np.asarray(self.way.T_wc(speed * seconds, lateral, yaw, sway, stride))
        T_wc = np.asarray(core.room_T_wc(_ROOM, seconds, 2 * _LOOKING_AROUND))
        aside = np.eye(4)
        aside[0, 3] = lateral
        aside[0, [0, 2]] = math.cos(yaw), math.sin(yaw)
        aside[2, [0, 2]] = -math.sin(yaw), math.cos(yaw)
        return np.asarray(T_wc @ aside)


# Sizes in metres; length goes along z (forward), breadth along x (right).
_ROOM = (6.0, 3.0, 6.0)  # along x (right), y (down), z (forward)
_LOOKING_AROUND = 15.0  # seconds, for half a turn
_CORRIDOR = {"length": 10.0, "breadth": 8.0, "width": 2.0}  # from outer wall to outer wall
_EIGHT = {"length": 10.0, "breadth": 12.0, "width": 2.0}
_HEIGHT = 2.6  # of corridors
_REPEAT = 4.0  # after which the pictures of the repeating corridor come again
_STREET_LENGTH, _STREET_WIDTH = 600.0, 12.0
_BLOCK = {"length": 208.0, "breadth": 104.0, "width": 14.0}  # between middles of its streets
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
}

#: How often the way is usually gone, for those that come back to their start.
LAPS = {
    SyntheticWorld.CORRIDOR: 1.2,
    SyntheticWorld.REPEATING_CORRIDOR: 1.2,
    SyntheticWorld.FIGURE_EIGHT: 1.1,
    SyntheticWorld.STREET_LAP: 1.2,
}


def make_scene(world: SyntheticWorld) -> Scene:
    """Choose the world and the way; the world itself is made later, when the seed is known."""
    if world is SyntheticWorld.ROOM:
        return Scene(lambda seed: core.make_room(_ROOM, seed, n_boxes=10), None)
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
    if world is SyntheticWorld.STREET_LAP:
        return Scene(
            lambda seed: core.make_street_lap(**_BLOCK, seed=seed),
            core.street_lap_way(**_BLOCK),
            speed=10.0,
            outdoors=True,
        )
    return Scene(
        lambda seed: core.make_street(_STREET_LENGTH, _STREET_WIDTH, seed),
        core.street_way(_STREET_LENGTH),
        speed=10.0,
        outdoors=True,
    )
