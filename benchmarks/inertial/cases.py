# SPDX-License-Identifier: BSD-3-Clause
"""Worlds and motions with an IMU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from orbslam2py.synthetic import SyntheticOptions

_INDOORS, _OUTDOORS = (320, 240), (620, 188)


@dataclass(frozen=True)
class Situation:
    """A world and a motion through it."""

    name: str
    options: dict[str, Any] = field(hash=False)


def _indoors(name: str, world: str, frames: int, **options: Any) -> Situation:
    return Situation(name, {"world": world, "frames": frames, "size": _INDOORS, **options})


SITUATIONS = [
    _indoors("corridor", "corridor", 400),
    _indoors("room", "room", 300),
    Situation("street", {"world": "street", "frames": 200, "size": _OUTDOORS, "pace": 1.0}),
    _indoors("corridor, stops", "corridor", 300, motion="stops"),
    _indoors("corridor, turns on the spot", "corridor", 300, motion="turn-on-the-spot"),
    _indoors("room, shakes", "room", 300, motion="shakes"),
    _indoors("corridor, shakes, 3 s dark", "corridor", 300, motion="shakes", cover=(7.0, 3.0)),
    _indoors("room, 3 s dark", "room", 300, cover=(7.0, 3.0)),
    _indoors("lift door", "lift-door", 300),
]
SENSORS = ("stereo", "rgbd", "mono")
CHIPS = ("mpu6050", "bmi088", "adis16448")


@dataclass(frozen=True)
class Case:
    """A situation, seen by a sensor, with a seed; several IMUs measure it."""

    situation: Situation
    sensor: str
    seed: int

    def options(self, chip: str) -> SyntheticOptions:
        """Return the sequence with the IMU of a chip; its images are those of any chip."""
        return SyntheticOptions(
            **self.situation.options,
            sensor=self.sensor,
            seed=self.seed,
            noise=2.0,
            depth_noise=0.005 if self.sensor == "rgbd" else 0.0,
            imu=True,
            imu_noise=chip,
        )


def cases(names: Sequence[str], sensors: Sequence[str], seeds: int) -> list[Case]:
    """All of them; the seeds of a row follow each other last."""
    chosen = [s for s in SITUATIONS if not names or s.name in names]
    return [
        Case(situation, sensor, seed)
        for seed in range(1, seeds + 1)
        for situation in chosen
        for sensor in sensors
    ]
