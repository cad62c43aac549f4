# SPDX-License-Identifier: BSD-3-Clause
"""Worlds and motions that are hard to follow, by sensors, features and seeds."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.holding_on.scene import OVERLAP, Floats, Integers, median_angle
from orbslam2py.datasets import Images
from orbslam2py.settings import Sensor, Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.rotations import inverse_poses

INDOORS, OUTDOORS, WHOLE = (320, 240), (620, 188), (1241, 376)
FEATURES = (1000, 400, 2000)
BLOCK = "block"
_NEAR_INDOORS, _NEAR_OUTDOORS = 0.5, 5.0  # see `Scene.near`


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
#: What images are like: noise in grey levels, exposure as a factor on the grey values, blur.
IMAGES: dict[str, dict[str, Any]] = {
    "noise of 0.3": {"noise": 0.3},
    "noise of 1": {"noise": 1.0},
    "noise of 3": {"noise": 3.0},
    "half blurred": {"noise": 1.0, "blur": 0.5},
    "half the contrast": {"noise": 1.0, "exposure": 0.5},
    "double contrast": {"noise": 1.0, "exposure": 2.0},
}
#: The IMU starts after some seconds: runs with it are this many times as long.
_LONGER_WITH_IMU = 3
_SEEN_BY = [
    {"world": "corridor", "frames": 100, "size": INDOORS},
    {"world": "room", "frames": 100, "size": INDOORS},
    {"world": "street", "frames": 70, "size": OUTDOORS},
]


class MadeUpScene:
    """A made-up sequence with the exact calibration; see `Scene`."""

    def __init__(self, options: SyntheticOptions, features: int) -> None:
        self.sequence = SyntheticSequence(options)
        self.sensor = Sensor(options.sensor)
        self.settings = with_features(self.sequence.default_settings(), features)
        self.imu = self.sequence.imu_settings() if options.imu else None
        self.samples = self.sequence.imu()
        self.timestamps = self.sequence.timestamps
        self.truth_variance = np.zeros(6)
        self.fps = self.sequence.camera.fps
        self.near = _NEAR_OUTDOORS if options.world.startswith("street") else _NEAR_INDOORS
        self._points: dict[int, Floats] = {}

    def __len__(self) -> int:
        return len(self.sequence)

    def load(self, index: int) -> Images:
        """Render an image."""
        return self.sequence.load(index)

    @cached_property
    def truth(self) -> Floats:
        """Poses of the way."""
        return self.sequence.ground_truth().T_wc

    @property
    def truth_part(self) -> Integers:
        """All of it is known."""
        return np.zeros(len(self), np.int64)

    def covered(self, index: int) -> bool:
        """Whether a hand is over the lens."""
        return self.sequence.covered(index)

    def parallax(self, first: int, second: int) -> float:
        """Median angle [rad] at which two views see the first one's points."""
        if first not in self._points:
            self._points[first] = self._points_in_view(first)
        points, camera = self._points[first], self.sequence.camera
        assert camera.width is not None and camera.height is not None
        T_wc = self.truth
        seen = camera.project(points, inverse_poses(T_wc[second]))
        inside = ((seen > 0) & (seen < (camera.width - 1, camera.height - 1))).all(axis=1)
        if len(points) == 0 or inside.mean() < OVERLAP:
            return 0.0
        rays = [points[inside] - T_wc[k, :3, 3] for k in (first, second)]
        return median_angle(*rays)

    def _points_in_view(self, frame: int) -> Floats:
        """Points of the world (m, 3) on a coarse grid over a frame."""
        camera = self.sequence.camera
        depth = self.sequence.exact_depth(frame)
        rows = np.linspace(4, depth.shape[0] - 5, 12).astype(int)
        columns = np.linspace(4, depth.shape[1] - 5, 16).astype(int)
        y, x = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        z = depth[y, x].astype(np.float64)
        seen = z > 0
        x, y, z = x[seen], y[seen], z[seen]
        rays = [(x - camera.cx) / camera.fx * z, (y - camera.cy) / camera.fy * z, z]
        T_wc = self.truth[frame]
        return np.asarray(np.stack(rays, axis=1) @ T_wc[:3, :3].T + T_wc[:3, 3])


@dataclass(frozen=True)
class MadeUpCase:
    """One run of a made-up world; see `Case`.

    Attributes
    ----------
    of
        World and motion.
    sensor, features, seed
        Of the run; the seed is that of the world, of its motion and of the system.
    chip
        Name of the IMU; None without one.
    """

    of: Situation
    sensor: str
    features: int
    seed: int
    chip: str | None = None

    @property
    def situation(self) -> str:
        """Name of world and motion."""
        return self.of.name

    @property
    def key(self) -> str:
        """Key that identifies the run."""
        world = f" | {self.of.options['world']}" if self.situation in IMAGES else ""
        chip = f" | {self.chip}" if self.chip is not None else ""
        return f"{self.situation}{world} | {self.sensor} | {self.features} | {self.seed}{chip}"

    def options(self) -> SyntheticOptions:
        """Options of the sequence."""
        options: dict[str, Any] = {"noise": 1.5, "depth_noise": 0.002, **self.of.options}
        if self.chip is not None:
            longer = _LONGER_WITH_IMU * options["frames"]
            options |= {"imu": True, "imu_noise": self.chip, "frames": longer}
        return SyntheticOptions(sensor=self.sensor, seed=self.seed, **options)

    def scene(self) -> MadeUpScene:
        """World and motion, to be played."""
        return MadeUpScene(self.options(), self.features)

    def described(self) -> str:
        """The options as text, so that a case can be played again by hand."""
        about = dataclasses.asdict(self.options())
        return json.dumps({k: v for k, v in about.items() if v is not None}, default=str)


def with_features(settings: Settings, features: int) -> Settings:
    """The same with another number of features."""
    return dataclasses.replace(settings, orb=dataclasses.replace(settings.orb, n_features=features))


def motion_cases(sensors: Sequence[str], chip: str | None = None) -> Iterator[MadeUpCase]:
    """Endless: every round plays all situations, with other sensors, features and a new seed.

    The first ones are as mixed as all of them, so any number of runs is a fair sample.
    """
    number = 0
    while True:
        turn, place = divmod(number, len(SITUATIONS))
        situation = SITUATIONS[place]
        sensor = sensors[(turn + place) % len(sensors)]
        features = FEATURES[(turn // len(sensors) + place) % len(FEATURES)]
        yield MadeUpCase(situation, sensor, features, turn, chip)
        number += 1


def image_cases(sensors: Sequence[str]) -> Iterator[MadeUpCase]:
    """Endless: every round plays all kinds of images in three worlds, with all sensors."""
    seed = 0
    while True:
        for name, kind in IMAGES.items():
            for world in _SEEN_BY:
                for sensor in sensors:
                    yield MadeUpCase(Situation(name, {**world, **kind}), sensor, 1000, seed)
        seed += 1


def block_cases(n: int) -> Iterator[MadeUpCase]:
    """Once around 320 m of street, and on into the loop: stereo, corners that begin at once."""
    options = {"world": "street-block", "corners": "sharp", "size": WHOLE, "laps": 1.15}
    for seed in range(n):
        yield MadeUpCase(Situation(BLOCK, options), "stereo", 2000, seed)
