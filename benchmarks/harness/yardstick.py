# SPDX-License-Identifier: BSD-3-Clause
"""Times in units of a well-known piece of work, so that figures of two machines can be compared."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.harness.folders import GOLDEN, shared_folder
from benchmarks.harness.reference import YARDSTICK


@dataclass(frozen=True)
class Times:
    """Milliseconds of repeated runs of one thing."""

    median: float
    least: float

    @staticmethod
    def of(values: list[float]) -> Times:
        return Times(statistics.median(values), min(values))


@dataclass(frozen=True)
class Measurement:
    """Something and the yardstick, measured in turns."""

    ours: Times
    yardstick: Times
    yardstick_there: float
    """Milliseconds of the yardstick on the reference's machine."""

    @property
    def slower(self) -> float:
        """How many times slower than the reference's machine this one is, now."""
        return self.yardstick.median / self.yardstick_there

    @property
    def carried(self) -> float:
        """Our median carried to the reference's machine [ms]."""
        return self.ours.median / self.slower


class Yardstick:
    """OpenCV's own ORB in one thread, on the images that the reference was measured with.

    Without the photographs synthetic images of the same sizes are used; then the figures are only
    roughly comparable, and `exact` is False.
    """

    def __init__(self) -> None:
        cv2.setNumThreads(1)
        self._shared = shared_folder()
        self.images = {name: self._image(name) for name in YARDSTICK}
        self._detectors = {
            name: cv2.ORB_create(n, 1.2, 8)  # type: ignore[attr-defined]
            for name, (n, _) in YARDSTICK.items()
        }

    @property
    def exact(self) -> bool:
        return self._shared is not None

    def _image(self, name: str) -> np.ndarray:
        if self._shared is not None:
            return np.load(self._shared / "golden" / f"extractor_{name}.npz")["image"]
        synthetic = {"tum_a": "extractor_synth7", "euroc_a": "extractor_synth11"}
        if name in synthetic:
            return np.load(GOLDEN / synthetic[name] / "image.npy")
        wide = np.hstack([np.load(GOLDEN / "extractor_synth7" / "image.npy")] * 2)
        return np.ascontiguousarray(wide[:376, :1241])

    def run(self, name: str) -> None:
        """One unit of the yardstick."""
        self._detectors[name].detectAndCompute(self.images[name], None)

    def compare(
        self, work: Callable[[], object], name: str = "tum_a", repeat: int = 30
    ) -> Measurement:
        """Run work and yardstick in turns, so that both see the same state of the machine."""
        work()
        self.run(name)
        ours, units = [], []
        for _ in range(repeat):
            units.append(milliseconds_of(lambda: self.run(name)))
            ours.append(milliseconds_of(work))
        return Measurement(Times.of(ours), Times.of(units), YARDSTICK[name][1])

    def around(
        self, works: Sequence[Callable[[], float]], name: str = "tum_a", repeat: int = 7
    ) -> Measurement:
        """Measure the yardstick before, between and after works that report their own times."""
        units, ours = [], []
        for work in (*works, None):
            self.run(name)
            units += [milliseconds_of(lambda: self.run(name)) for _ in range(repeat)]
            if work is not None:
                ours.append(work())
        return Measurement(Times.of(ours), Times.of(units), YARDSTICK[name][1])


def milliseconds_of(work: Callable[[], object]) -> float:
    """Wall-clock time of one call."""
    begin = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begin)
