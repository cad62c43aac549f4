# SPDX-License-Identifier: BSD-3-Clause
"""Worlds seen in pieces: what is seen in which order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np

from benchmarks.several_maps.pieces import Order, with_covered
from orbslam2py import Sensor
from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import Images
from orbslam2py.settings import Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

FPS = 20.0
#: Frames of a covered lens: three seconds.
COVERED = round(3 * FPS)


class DifferentRooms(SyntheticSequence):
    """The way through `two-rooms`, where the second room has another wallpaper."""

    @cached_property
    def _built(self) -> core.World:
        twins = super()._built.rectangles
        one_room = (len(twins) - 4) // 2  # the passage between them has four walls
        for rectangle in twins[one_room : 2 * one_room]:
            rectangle.texture = (rectangle.texture ^ 0x5EED) + 1
        return core.World(twins)


class Rendered:
    """A made-up sequence whose images are kept: rendering takes about as long as tracking."""

    def __init__(self, source: SyntheticSequence) -> None:
        self._source = source
        self._kept = cache(source.load)

    def __len__(self) -> int:
        return len(self._source)

    @property
    def settings(self) -> Settings:
        """Those of its camera."""
        return self._source.settings

    @property
    def true_positions(self) -> FloatArray:
        """Of the camera (n, 3) [m]."""
        return np.array([self._source.T_wc(i)[:3, 3] for i in range(len(self))])

    def load(self, index: int, /) -> Images:
        """The images of a frame."""
        return self._kept(index)


@lru_cache(maxsize=1)
def _rendered(
    kind: Callable[[SyntheticOptions], SyntheticSequence], options: SyntheticOptions
) -> Rendered:
    return Rendered(kind(options))


@dataclass(frozen=True)
class Case:
    """A world and the order in which its frames come.

    Attributes
    ----------
    name, world
        Which.
    order
        Of so many frames.
    source
        Makes the sequence.
    can_be_told
        Whether the images say where the pieces belong. If not, each is judged by itself.
    unbroken
        Where the uncut sequence closes a loop that the pieces leave open: their way in one go.
    """

    name: str
    world: str
    order: Callable[[int, np.random.Generator], Order]
    source: Callable[[SyntheticOptions], SyntheticSequence] = SyntheticSequence
    can_be_told: bool = True
    unbroken: Callable[[int], Order] | None = None

    @property
    def scene(self) -> str:
        """What is seen; the uncut sequence is run once for each."""
        return f"{self.world}{'' if self.source is SyntheticSequence else '-different'}"

    def sequence(self, sensor: Sensor, seed: int) -> Rendered:
        """The uncut sequence; the last one that was asked for is kept."""
        options = SyntheticOptions(
            world=self.world, sensor=sensor, size=(320, 240), pace=2.0, fps=FPS, seed=seed
        )
        return _rendered(self.source, options)


def _parts(n: int, *bounds: tuple[float, float]) -> list[range]:
    return [range(int(first * n), int(last * n)) for first, last in bounds]


def _kidnapped(n: int, _: np.random.Generator) -> Order:
    """Covered for three seconds and set down elsewhere; walks into the known part."""
    return with_covered(_parts(n, (0, 0.29), (0.53, 1)), COVERED)


def _open_lap(n: int) -> Order:
    """The way of the kidnapped, from where it was set down to where it was taken."""
    return [*range(int(0.53 * n), n), *range(round(n - n / 1.2), int(0.29 * n))]


def _shuffled(n: int, random: np.random.Generator) -> Order:
    """A lap in five pieces that overlap a little, in any order.

    A single camera begins each of them with another scale.
    """
    bounds = np.linspace(0, n, 6).astype(int)
    pieces = []
    for k in random.permutation(5):
        first, last = max(0, bounds[k] - n // 10), min(n, bounds[k + 1] + n // 20)
        pieces.append(range(int(first), int(last)))
    return with_covered(pieces, COVERED)


def _two_places(n: int, _: np.random.Generator) -> Order:
    """One corridor, the light goes off, another one, and the leg that both share found later."""
    return with_covered(_parts(n, (0, 0.3), (0.5, 1)), COVERED)


def _open_eight(n: int) -> Order:
    """The same in one go."""
    return [*range(int(0.5 * n), n), *range(round(n - n / 1.1), int(0.3 * n))]


def _door(n: int, _: np.random.Generator) -> Order:
    """One room, the light goes off, another room, and the door to the first found later."""
    return with_covered(_parts(n, (0.62, 0.9), (0, 0.8)), COVERED)


def _alike(n: int, _: np.random.Generator) -> Order:
    """Both of two rooms that look the same are known; set down in one of them."""
    return with_covered(_parts(n, (0, 1), (0.8, 1)), COVERED)


def _twin(n: int, _: np.random.Generator) -> Order:
    """One of two rooms that look the same is known; set down in the other."""
    return with_covered(_parts(n, (0, 0.4), (0.62, 1)), COVERED)


CASES = (
    Case("kidnapped", "corridor", _kidnapped, unbroken=_open_lap),
    Case("repeating", "repeating-corridor", _kidnapped, unbroken=_open_lap),
    Case("five-pieces", "corridor", _shuffled),
    Case("two-places", "figure-eight", _two_places, unbroken=_open_eight),
    Case("door", "two-rooms", _door, source=DifferentRooms),
    Case("alike", "two-rooms", _alike),
    Case("twin", "two-rooms", _twin, can_be_told=False),
)
