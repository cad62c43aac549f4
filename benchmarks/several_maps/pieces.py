# SPDX-License-Identifier: BSD-3-Clause
"""A sequence in pieces: put together in another order, with a covered lens between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from orbslam2py import Sensor, System, TrackingRecord, Trajectory
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.datasets import Images
from orbslam2py.evaluation import align

#: Indices of frames; None: a covered lens.
Order = list[int | None]


class Source(Protocol):
    """Images by their number."""

    def load(self, index: int, /) -> Images: ...


@dataclass(frozen=True)
class Found:
    """The frames of one map: indices (n,) in the source and positions (n, 3)."""

    indices: IntArray
    positions: FloatArray

    def __len__(self) -> int:
        return len(self.indices)

    def among(self, wanted: IntArray) -> Found:
        """Those of some frames."""
        chosen = np.isin(self.indices, wanted)
        return Found(self.indices[chosen], self.positions[chosen])

    def error(self, truth: FloatArray, *, monocular: bool) -> float:
        """Root mean square distance from true positions (n, 3) of the source's frames [m].

        NaN where too few frames are tracked. True positions may be NaN.
        """
        known = np.isfinite(truth[self.indices]).all(axis=1)
        if known.sum() < 5:
            return float("nan")
        there, found = truth[self.indices[known]], self.positions[known]
        off = align(found, there, with_scale=monocular).apply(found) - there
        return float(np.sqrt((off**2).sum(axis=1).mean()))


@dataclass(frozen=True)
class Pieces:
    """Frames of a sequence in any order, at a steady rate; None: a covered lens."""

    source: Source
    order: tuple[int | None, ...]
    seconds_per_frame: float

    def load(self, position: int) -> Images:
        """The images of a frame."""
        index = self.order[position]
        if index is not None:
            return self.source.load(index)
        images = self.source.load(0)
        return Images(
            np.zeros_like(images.image),
            right=None if images.right is None else np.zeros_like(images.right),
            depth=None if images.depth is None else np.zeros_like(images.depth),
        )

    def track(self, system: System) -> list[TrackingRecord]:
        """Track all frames."""
        records = []
        for position in range(len(self.order)):
            images, t = self.load(position), position * self.seconds_per_frame
            if system.sensor is Sensor.MONOCULAR:
                records.append(system.track_monocular(images.image, t))
            elif system.sensor is Sensor.STEREO:
                assert images.right is not None
                records.append(system.track_stereo(images.image, images.right, t))
            else:
                assert images.depth is not None
                records.append(system.track_rgbd(images.image, images.depth, t))
        system.wait_until_idle()
        return records

    @property
    def n_seen(self) -> int:
        """Frames whose lens is not covered."""
        return sum(index is not None for index in self.order)

    def found(self, path: Trajectory) -> Found:
        """The frames of the source that a path has poses of; the covered ones are left out."""
        path = path.select(~path.lost)
        indices = np.array(
            [-1 if (i := self.order[p]) is None else i for p in self.positions_of(path)], np.int64
        )
        return Found(indices[indices >= 0], path.positions[indices >= 0])

    def positions_of(self, path: Trajectory) -> IntArray:
        """Where in the order the frames of a path stand, (n,)."""
        return np.rint(path.timestamps / self.seconds_per_frame).astype(np.int64)


def covered(seconds: float, seconds_per_frame: float) -> Order:
    """Frames of a covered lens."""
    return [None] * round(seconds / seconds_per_frame)


def with_covered(pieces: list[range], n_covered: int) -> Order:
    """Pieces one after the other, the lens covered for so many frames between them."""
    order: Order = []
    for number, piece in enumerate(pieces):
        order += [None] * (n_covered if number else 0) + list(piece)
    return order


def largest_of(paths: list[Trajectory]) -> Trajectory:
    """The path with most tracked frames."""
    return max(paths, key=lambda path: int(np.count_nonzero(~path.lost)))
