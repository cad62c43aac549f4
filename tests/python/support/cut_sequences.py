# SPDX-License-Identifier: BSD-3-Clause
"""Sequences cut into pieces: in another order, with a covered lens between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import orbslam2py as orb
from orbslam2py.datasets import Images
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

#: Frames per second of cut sequences.
FPS = 20.0


@dataclass(frozen=True)
class Cut:
    """Frames of a sequence in any order, at a steady rate; None: a covered lens."""

    source: SyntheticSequence
    order: tuple[int | None, ...]

    def __len__(self) -> int:
        return len(self.order)

    def load(self, i: int) -> Images:
        """The images of the i-th frame."""
        index = self.order[i]
        if index is not None:
            return self.source.load(index)
        images = self.source.load(0)
        black = np.zeros_like(images.image)
        right = None if images.right is None else black
        depth = None if images.depth is None else np.zeros_like(images.depth)
        return Images(black, right=right, depth=depth)

    def timestamp(self, i: int) -> float:
        """Seconds."""
        return i / FPS

    def T_wc(self, i: int) -> np.ndarray:
        """True pose of the i-th frame."""
        index = self.order[i]
        assert index is not None
        return self.source.T_wc(index)


def cut(options: SyntheticOptions, *pieces: range | int) -> Cut:
    """Put pieces of a sequence together; a number stands for so many frames of a covered lens."""
    order: list[int | None] = []
    for piece in pieces:
        order += [None] * piece if isinstance(piece, int) else list(piece)
    return Cut(SyntheticSequence(options), tuple(order))


def corridor(sensor: str, seed: int = 0, **kinds: object) -> SyntheticOptions:
    """A corridor around a block at a walk, in small images: 376 frames a lap, 451 in all."""
    given = {"world": "corridor", "pace": 2.0, "size": (320, 240), "fps": FPS, **kinds}
    return SyntheticOptions(sensor=sensor, seed=seed, **given)


def track(system: orb.System, sequence: Cut, frames: Sequence[int] | None = None) -> list:
    """Track frames of a cut sequence; their records."""
    records = []
    for i in range(len(sequence)) if frames is None else frames:
        images = sequence.load(i)
        t = sequence.timestamp(i)
        if system.sensor is orb.Sensor.RGBD:
            records.append(system.track_rgbd(images.image, images.depth, t))
        elif system.sensor is orb.Sensor.STEREO:
            records.append(system.track_stereo(images.image, images.right, t))
        else:
            records.append(system.track_monocular(images.image, t))
    return records


def settings_of(sequence: Cut) -> orb.Settings:
    """Of its camera."""
    return sequence.source.settings
