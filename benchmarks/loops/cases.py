# SPDX-License-Identifier: BSD-3-Clause
"""Worlds in which places are seen again, or only seem to be, with settings that make drift.

Fewer pixels and features than a real camera's, noise, and few images per metre: without loop
closing, a lap ends half a percent of its length beside its start or more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from orbslam2py import Sensor, Settings, load_vocabulary
from orbslam2py.runs import RunOptions, RunResult, SequenceRunner, SystemOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence, SyntheticWorld


@dataclass(frozen=True)
class Case:
    """A world, a sensor, and what is to be found there."""

    world: SyntheticWorld
    sensor: Sensor
    n_revisits: int
    """Places that are seen again, each a loop to close; 0: every closed loop is a false one."""
    laps: float | None = None
    features: int = 600
    noise: float = 12.0
    depth_noise: float = 0.0
    size: tuple[int, int] = (360, 270)
    fps: float = 10.0
    speed: float | None = 1.0

    @property
    def name(self) -> str:
        """Of the world."""
        return str(self.world)

    def __str__(self) -> str:
        return f"{self.name} {self.sensor}"

    @property
    def near(self) -> float:
        """Metres between cameras that are at the same place."""
        return 8.0 if self._is_street else 1.0

    @property
    def apart(self) -> float:
        """Metres of path between two visits of a place."""
        return 100.0 if self._is_street else 10.0

    @property
    def _is_street(self) -> bool:
        return self.world in (SyntheticWorld.STREET, SyntheticWorld.STREET_LAP)

    def sequence(self, seed: int) -> SyntheticSequence:
        """Make its images."""
        return SyntheticSequence(
            SyntheticOptions(
                world=self.world,
                sensor=self.sensor,
                laps=self.laps,
                fps=self.fps,
                speed=self.speed,
                size=self.size,
                seed=seed,
                noise=self.noise,
                depth_noise=self.depth_noise,
            )
        )

    def settings(self, sequence: SyntheticSequence) -> Settings:
        """Exact calibration, and the number of features."""
        settings = sequence.settings
        return replace(settings, orb=replace(settings.orb, n_features=self.features))

    def run(
        self, sequence: SyntheticSequence, seed: int, *, loop_closing: bool, deterministic: bool
    ) -> RunResult:
        """Run over the images of the seed, which also chooses all random draws."""
        system = SystemOptions(deterministic=deterministic, seed=seed, loop_closing=loop_closing)
        runner = SequenceRunner(
            sequence, self.settings(sequence), load_vocabulary(), RunOptions(self.sensor, system)
        )
        return runner.run()

    def describe(self) -> str:
        """Settings in words."""
        sequence = self.sequence(0)
        lap = sequence.lap_length
        around = "" if lap is None else f", lap of {lap:.0f} m"
        width, height = self.size
        return (
            f"{len(sequence)} frames{around}, {self.n_revisits} places seen again; {width}x"
            f"{height}, {self.features} features, noise {self.noise:g} grey levels, depth noise"
            f" {self.depth_noise:g} m at 1 m, {self.fps:g} frames/s"
        )


_EIGHT = SyntheticWorld.FIGURE_EIGHT
_CORRIDOR = SyntheticWorld.CORRIDOR
_REPEATING = SyntheticWorld.REPEATING_CORRIDOR
_BLOCK = SyntheticWorld.STREET_LAP
_STREET = SyntheticWorld.STREET
_ROOMS = SyntheticWorld.TWO_ROOMS

CASES = (
    Case(_CORRIDOR, Sensor.STEREO, 1, 1.5),
    Case(_CORRIDOR, Sensor.RGBD, 1, 1.5, depth_noise=0.03),
    Case(_CORRIDOR, Sensor.MONOCULAR, 1, 1.5, 1000, 5, size=(480, 360), fps=15, speed=0.7),
    Case(_EIGHT, Sensor.STEREO, 2, 1.2),
    Case(_EIGHT, Sensor.RGBD, 2, 1.2, depth_noise=0.03),
    Case(_BLOCK, Sensor.STEREO, 1, 1.2, 1000, size=(496, 150), speed=10),
    Case(_REPEATING, Sensor.STEREO, 1, 1.5),
    Case(_REPEATING, Sensor.RGBD, 1, 1.5, depth_noise=0.03),
    Case(_REPEATING, Sensor.MONOCULAR, 1, 1.5, 1000, 5, size=(480, 360), fps=15, speed=0.7),
    Case(_STREET, Sensor.STEREO, 0, None, 1000, size=(496, 150), speed=10),
    Case(_ROOMS, Sensor.STEREO, 0, speed=0.6),
    Case(_ROOMS, Sensor.RGBD, 0, depth_noise=0.03, speed=0.6),
    Case(_ROOMS, Sensor.MONOCULAR, 0, None, 1000, 5, size=(480, 360), fps=15, speed=0.4),
)
