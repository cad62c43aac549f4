# SPDX-License-Identifier: BSD-3-Clause
"""A system with the map of a synthetic world, and errors of poses that do not count its drift."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from orbslam2py import Sensor, System, TrackingRecord, TrackingState
from orbslam2py.datasets import Images
from orbslam2py.evaluation import align
from orbslam2py.synthetic import SyntheticSequence
from support.feeding import blackened, feed

Array = np.ndarray


@dataclass(frozen=True)
class PoseError:
    """Distance from the truth."""

    metres: float
    degrees: float

    @property
    def small(self) -> bool:
        """Within 2 cm and 0.5 degrees."""
        return self.metres <= 0.02 and self.degrees <= 0.5


class MappedWorld:
    """A system that has seen a synthetic sequence, or a part of it.

    Errors are measured through the nearest mapped keyframe: the pose relative to its estimate
    against the true pose relative to its truth, so that the map's own drift does not count. With a
    single camera, lengths are those of the mapped path aligned by Sim(3).
    """

    def __init__(self, sequence: SyntheticSequence, frames: Iterable[int], seed: int = 0) -> None:
        self.sequence = sequence
        self.system = System(sequence.settings, sequence.sensor, deterministic=True, seed=seed)
        self._n_shown = 0
        self._true: dict[float, Array] = {}
        self.n_tracked = self.n_frames = 0
        for index in frames:
            record = self.show(sequence.load(index), sequence.T_wc(index))
            self.n_tracked += record.state is TrackingState.OK
            self.n_frames += 1
        self._take_keyframes()

    def _take_keyframes(self) -> None:
        keyframes = self.system.keyframe_trajectory()
        self._estimated_T_wk = keyframes.T_wc
        self._true_T_wk = np.array([self._true[float(t)] for t in keyframes.timestamps])
        self.scale = 1.0
        if self.sequence.sensor is Sensor.MONOCULAR:
            positions = [poses[:, :3, 3] for poses in (self._estimated_T_wk, self._true_T_wk)]
            self.scale = align(*positions, with_scale=True).scale

    # ---- images ----------------------------------------------------------------------------------
    def show(self, shown: Images, T_wc: Array | None = None) -> TrackingRecord:
        """Track the images, 50 ms after the last ones."""
        seconds = self._n_shown / 20
        self._n_shown += 1
        if T_wc is not None:
            self._true[seconds] = T_wc
        return feed(self.system, shown, seconds)

    def black(self) -> Images:
        """Images in which nothing can be seen."""
        return blackened(self.sequence.load(0))

    def lose(self, n_frames: int = 1) -> TrackingRecord:
        """Show black images."""
        black = self.black()
        for _ in range(n_frames):
            record = self.show(black)
        return record

    # ---- errors ----------------------------------------------------------------------------------
    def error(self, record: TrackingRecord, T_wc: Array) -> PoseError:
        """Of a tracked frame, relative to the nearest mapped keyframe."""
        assert record.T_wc is not None
        distance = np.linalg.norm(self._true_T_wk[:, :3, 3] - T_wc[:3, 3], axis=1)
        cosine = np.einsum("nij,ij->n", self._true_T_wk[:, :3, :3], T_wc[:3, :3])
        # A metre is as far as a radian.
        angle = np.arccos(np.clip((cosine - 1) / 2, -1, 1))
        nearest = int(np.argmin(distance + angle))
        true = np.linalg.inv(self._true_T_wk[nearest]) @ T_wc
        estimated = np.linalg.inv(self._estimated_T_wk[nearest]) @ record.T_wc
        estimated[:3, 3] *= self.scale
        return pose_error(estimated, true)


def pose_error(estimated: Array, true: Array) -> PoseError:
    """Between two poses (4, 4) [m]."""
    difference = np.linalg.inv(estimated) @ true
    cosine = (np.trace(difference[:3, :3]) - 1) / 2
    return PoseError(
        float(np.linalg.norm(difference[:3, 3])),
        float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
    )


def beside(T_wc: Array, rng: np.random.Generator, metres: float, degrees: float) -> Array:
    """A viewpoint drawn within a distance and an angle of another: direction, axis and size."""
    moved = np.eye(4)
    direction = rng.standard_normal(3)
    moved[:3, 3] = direction / np.linalg.norm(direction) * metres * rng.random() ** (1 / 3)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    angle = np.radians(degrees) * rng.random()
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    moved[:3, :3] = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return T_wc @ moved
