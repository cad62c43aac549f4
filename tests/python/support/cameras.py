# SPDX-License-Identifier: BSD-3-Clause
"""A camera that is none."""

from __future__ import annotations

from orbslam2py import DatasetError
from orbslam2py.datasets import LiveFrame
from orbslam2py.synthetic import SyntheticSequence


class Camera:
    """Delivers the images of a sequence as a camera does; every other one is lost."""

    layout, name = "camera", "camera0"

    def __init__(self, sequence: SyntheticSequence, *, fails: bool = False) -> None:
        self._sequence = sequence
        self._fails = fails
        self.sensor, self.settings = sequence.sensor, sequence.settings
        self.n_dropped = 0
        self.is_open = False
        self._next = 0

    def open(self) -> None:
        pass

    def __enter__(self) -> Camera:
        self.is_open = True
        return self

    def __exit__(self, *_: object) -> None:
        self.is_open = False

    def ground_truth(self) -> None:
        return None

    def take(self, timeout: float, /) -> LiveFrame | None:
        if self._next == 4:
            if self._fails:
                raise DatasetError("unplugged")
            return None
        index, self._next = self._next, self._next + 1
        self.n_dropped += 1
        time = float(self._sequence.timestamps[index])
        return LiveFrame(time, f"{time:.6f}", self._sequence.load(index))
