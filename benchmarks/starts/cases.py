# SPDX-License-Identifier: BSD-3-Clause
"""Starts of a single camera: recordings, first images and seeds."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness.folders import sequence_folder
from benchmarks.holding_on.recorded import Change, RecordedScene, Recording
from orbslam2py.datasets import open_sequence
from orbslam2py.settings import Sensor

#: Images that a start is judged by: it may wait, and then 30 frames and more follow.
LASTS = 110
#: Where the first image lies, as a share of what may be left out.
FIRST_IMAGES = 5

RECORDINGS = [
    Recording("tum_fr1_desk_rgb110", ("mono",), 0.5),
    Recording("7scenes_redkitchen_head250", ("mono",), 0.5, True, (122,)),
    Recording("kitti_03_left_head120", ("mono",), 5.0),
    Recording("kitti_06_head51_stereo", ("mono",), 5.0),
    Recording("euroc_MH_01_first170", ("mono",), 0.5, body_truth="groundtruth.txt"),
    Recording("euroc_V1_01_flight90", ("mono",), 0.5, body_truth="groundtruth.txt"),
    Recording("kitti_raw_0926_0001_left", ("mono",), 5.0, has_truth=False),
    Recording("drone_semicircle", ("mono",), 0.5, has_truth=False),
]


@functools.lru_cache
def _length(name: str) -> int:
    return len(open_sequence(sequence_folder(name), Sensor.MONOCULAR))  # type: ignore[arg-type]


@functools.lru_cache
def _features(name: str) -> int:
    return open_sequence(sequence_folder(name), Sensor.MONOCULAR).settings.orb.n_features


def _from(first: int, n: int, random: np.random.Generator) -> NDArray[np.int64]:
    return np.arange(first, min(first + LASTS, n))


@dataclass(frozen=True)
class StartCase:
    """One start; see `benchmarks.holding_on.scene.Case`."""

    recording: Recording
    first: int
    seed: int
    sensor: str = "mono"

    @property
    def features(self) -> int:
        """Those of its settings."""
        return _features(self.recording.name)

    @property
    def situation(self) -> str:
        """The recording."""
        return self.recording.name

    @property
    def key(self) -> str:
        """Key that identifies the run."""
        return f"{self.recording.name} | {self.first} | {self.seed}"

    def scene(self) -> RecordedScene:
        """The images from the first one on."""
        change = Change(f"from {self.first}", functools.partial(_from, self.first))
        return RecordedScene(self.recording, Sensor.MONOCULAR, change, self.features, self.seed)

    def described(self) -> str:
        """As text."""
        return f"{{{dataclasses.astuple(self)}}}"


def start_cases(n_seeds: int, only: str | None = None) -> Iterator[StartCase]:
    """All recordings from five first images each; every seed plays all of them once."""
    for seed in range(n_seeds):
        for recording in RECORDINGS:
            if only is not None and only not in recording.name:
                continue
            # The last start leaves half of the images, so that there is something to begin from.
            for first in np.linspace(0, _length(recording.name) // 2, FIRST_IMAGES).astype(int):
                yield StartCase(recording, int(first), seed)
