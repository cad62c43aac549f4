# SPDX-License-Identifier: BSD-3-Clause
"""What is played: worlds and motions, by sensors, features and seeds."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from orbslam2py.settings import Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

INDOORS, OUTDOORS, WHOLE = (320, 240), (620, 188), (1241, 376)
FEATURES = (1000, 400, 2000)
BLOCK = "block"


@dataclass(frozen=True)
class Situation:
    """A world and a motion through it.

    Attributes
    ----------
    name
        Of both, as the tables show it.
    options
        Fields of `SyntheticOptions`.
    sensors
        With which it is played; None: all.
    """

    name: str
    options: dict[str, Any] = field(hash=False)
    sensors: tuple[str, ...] | None = None

    @property
    def world(self) -> str:
        return str(self.options["world"])


def _indoors(name: str, world: str, frames: int = 100, **options: Any) -> Situation:
    return Situation(
        f"{world}, {name}", {"world": world, "frames": frames, "size": INDOORS, **options}
    )


def _outdoors(name: str, world: str, frames: int = 70, **options: Any) -> Situation:
    return Situation(
        f"{world}, {name}", {"world": world, "frames": frames, "size": OUTDOORS, **options}
    )


SITUATIONS = [
    _indoors("half the pace", "corridor", pace=0.5),
    _indoors("turns at once", "corridor", motion="turns-at-once"),
    _outdoors("turns at once", "street", motion="turns-at-once"),
    _indoors("smooth", "table-top"),
    _indoors("turns on the spot", "corridor", motion="turn-on-the-spot"),
    _indoors("stops", "wall", motion="stops"),
    _outdoors("sharp corners", "street-block", corners="sharp"),
    _indoors("door", "lift-door"),
    _indoors("stairs", "corridor", motion="stairs"),
    _indoors("turns at once", "two-rooms", motion="turns-at-once"),
    _indoors("double pace, sharp corners", "corridor", pace=2.0, corners="sharp"),
    _outdoors("double pace", "street", frames=60, pace=2.0),
    _indoors("shakes, half blurred", "corridor", motion="shakes", blur=0.5),
    _indoors("hand over the lens for 1 s", "corridor", cover=1.0, pace=0.7),
    _indoors("exposure jumps", "corridor", exposure=(0.35, 1.6)),
    _indoors("turns on the spot, blurred", "two-rooms", motion="turn-on-the-spot", blur=1.0),
    _outdoors("stops", "street", motion="stops"),
    _indoors("shakes", "table-top", motion="shakes"),
    _indoors("turns at once, blurred", "corridor", motion="turns-at-once", blur=1.0),
    _indoors("fourfold pace", "corridor", frames=80, pace=4.0),
    _indoors("double pace, turns at once", "room", pace=2.0, motion="turns-at-once"),
    _indoors("hand over the lens for 0.5 s", "table-top", cover=0.5),
    _outdoors(
        "sharp corners, exposure jumps", "street-block", corners="sharp", exposure=(0.5, 1.5)
    ),
    _indoors("fourfold pace", "wall", frames=80, pace=4.0),
    _outdoors("shakes, half blurred", "street-block", motion="shakes", blur=0.5),
    _indoors("turns on the spot", "room", motion="turn-on-the-spot"),
]
SENSORS = ("stereo", "rgbd", "mono")


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes
    ----------
    situation
        World and motion.
    sensor, features, seed
        Of the run; the seed is that of the world, of its motion and of the system.
    """

    situation: Situation
    sensor: str
    features: int
    seed: int

    @property
    def key(self) -> str:
        return f"{self.situation.name} | {self.sensor} | {self.features} | {self.seed}"

    def options(self) -> SyntheticOptions:
        return SyntheticOptions(
            sensor=self.sensor,
            seed=self.seed,
            noise=1.5,
            depth_noise=0.002,
            **self.situation.options,
        )

    def sequence(self) -> SyntheticSequence:
        return SyntheticSequence(self.options())

    def settings(self, sequence: SyntheticSequence) -> Settings:
        """The exact calibration, with the case's number of features."""
        settings = sequence.default_settings()
        orb = dataclasses.replace(settings.orb, n_features=self.features)
        return dataclasses.replace(settings, orb=orb)

    def described(self) -> str:
        """The options as text, so that a case can be played again by hand."""
        about = dataclasses.asdict(self.options())
        return json.dumps({k: v for k, v in about.items() if v is not None}, default=str)


def motion_cases(sensors: Sequence[str]) -> Iterator[Case]:
    """Endless: every round plays all situations, with other sensors, features and a new seed.

    The first ones are as mixed as all of them, so any number of runs is a fair sample.
    """
    number = 0
    while True:
        turn, place = divmod(number, len(SITUATIONS))
        situation = SITUATIONS[place]
        sensor = sensors[(turn + place) % len(sensors)]
        features = FEATURES[(turn // len(sensors) + place) % len(FEATURES)]
        yield Case(situation, sensor, features, seed=turn)
        number += 1


def block_cases(n: int) -> Iterator[Case]:
    """Once around 320 m of street, and on into the loop: stereo, corners that begin at once."""
    options = {"world": "street-block", "corners": "sharp", "size": WHOLE, "laps": 1.15}
    for seed in range(n):
        yield Case(Situation(BLOCK, options), "stereo", 2000, seed)
