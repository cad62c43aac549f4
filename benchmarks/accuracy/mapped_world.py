# SPDX-License-Identifier: BSD-3-Clause
"""A system that has mapped a part of a synthetic world, to be shown other images of it."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from orbslam2py import Sensor, System, TrackingRecord, TrackingState
from orbslam2py.datasets import Images
from orbslam2py.evaluation import PoseError, align, errors_through_keyframes
from orbslam2py.synthetic import SyntheticSequence

SECONDS_PER_FRAME = 0.05


class MappedWorld:
    """Frames of a sequence, mapped.

    Errors are taken through the nearest keyframe of this map, so that its own drift does not count;
    with a single camera, in lengths of the mapped path aligned by Sim(3).
    """

    def __init__(self, sequence: SyntheticSequence, frames: Iterable[int], seed: int = 0) -> None:
        self.sequence = sequence
        # All images are searched in this map only.
        self.system = System(
            sequence.settings, sequence.sensor, deterministic=True, seed=seed, several_maps=False
        )
        self._n_shown = 0
        shown = list(frames)
        self.n_frames = len(shown)
        records = [self.show(sequence.load(index)) for index in shown]
        self.n_tracked = sum(record.state is TrackingState.OK for record in records)
        keyframes = self.system.keyframe_trajectory()
        self._T_wk = keyframes.T_wc
        places = np.rint(keyframes.timestamps / SECONDS_PER_FRAME).astype(int)
        self.true_T_wk = np.array([sequence.T_wc(shown[place]) for place in places])
        self.metres_per_unit = 1.0
        if sequence.sensor is Sensor.MONOCULAR:
            fit = align(keyframes.positions, self.true_T_wk[:, :3, 3], with_scale=True)
            self.metres_per_unit = fit.scale

    def show(self, images: Images) -> TrackingRecord:
        """Track the images, 50 ms after the last ones."""
        seconds = self._n_shown * SECONDS_PER_FRAME
        self._n_shown += 1
        return self.system.track(images, seconds)

    def black(self) -> Images:
        """Images in which nothing can be seen."""
        seen = self.sequence.load(0)
        parts = (seen.image, seen.right, seen.depth)
        return Images(*(None if part is None else 0 * part for part in parts))

    def lose(self, n_frames: int = 1) -> TrackingRecord:
        """Show black images, after which tracking must be lost."""
        black = self.black()
        for _ in range(n_frames):
            record = self.show(black)
        assert record.state is TrackingState.LOST
        return record

    def error(self, record: TrackingRecord, true_T_wc: np.ndarray) -> PoseError:
        """Of a tracked frame."""
        metres, radians = errors_through_keyframes(
            record.T_wc[None],
            true_T_wc[None],
            self._T_wk,
            self.true_T_wk,
            metres_per_unit=self.metres_per_unit,
        )
        return PoseError(float(metres[0]), float(np.degrees(radians[0])))


def beside(T_wc: np.ndarray, rng: np.random.Generator, metres: float, degrees: float) -> np.ndarray:
    """A viewpoint drawn within a distance and an angle of another: direction, axis and size."""
    moved = np.eye(4)
    direction = rng.standard_normal(3)
    moved[:3, 3] = direction / np.linalg.norm(direction) * metres * rng.random() ** (1 / 3)
    axis = rng.standard_normal(3)
    angle = np.radians(degrees) * rng.random()
    moved[:3, :3], _ = cv2.Rodrigues(axis / np.linalg.norm(axis) * angle)
    return T_wc @ moved
