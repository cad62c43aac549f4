# SPDX-License-Identifier: BSD-3-Clause
"""A sequence in pieces: put together in another order, with a covered lens between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py import Sensor, System, TrackingRecord, Trajectory
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import Images, Sequence
from orbslam2py.evaluation import align


@dataclass(frozen=True)
class Pieces:
    """Frames of a sequence in any order, at a steady rate; None: a covered lens."""

    source: Sequence
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

    def error_of(self, path: Trajectory, truth: FloatArray, *, monocular: bool) -> float:
        """Root mean square distance from true positions (n, 3) of the source's frames [m].

        NaN where too few frames are tracked.
        """
        path = path.select(~path.lost)
        positions = np.rint(path.timestamps / self.seconds_per_frame).astype(int)
        indices = np.array([-1 if (i := self.order[p]) is None else i for p in positions], int)
        known = indices >= 0
        known[known] = np.isfinite(truth[indices[known]]).all(axis=1)
        if known.sum() < 5:
            return float("nan")
        there, found = truth[indices[known]], path.positions[known]
        off = align(found, there, with_scale=monocular).apply(found) - there
        return float(np.sqrt((off**2).sum(axis=1).mean()))


def covered(seconds: float, seconds_per_frame: float) -> list[int | None]:
    """Frames of a covered lens."""
    return [None] * round(seconds / seconds_per_frame)
