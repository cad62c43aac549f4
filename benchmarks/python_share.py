# SPDX-License-Identifier: BSD-3-Clause
"""How much of a frame's time is Python between the C++ steps.

Every function, method and property of the extension that orchestration uses is replaced by one that
also notes its time; the rest of the track call is Python. Mapping runs inline (deterministic mode),
so that no other thread's use of the interpreter is counted on either side. What the noting
itself costs outside the noted time is measured with a function that does nothing and taken off;
destructors of C++ objects count as Python.

    python benchmarks/python_share.py FOLDER rgbd
"""

from __future__ import annotations

import argparse
import inspect
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py import _core as core
from orbslam2py.datasets import open_sequence
from orbslam2py.records import TrackingRecord
from orbslam2py.runner import RunOptions, SequenceRunner
from orbslam2py.sensor import Sensor
from orbslam2py.system import System

_CLASSES = (
    core.Map,
    core.Frame,
    core.LocalMap,
    core.LocalMapMatches,
    core.PoseEstimate,
    core.TrackedFrame,
    core.OrbExtractor,
    core.PairExtractor,
    core.TrajectoryRecorder,
    core.RecentPoints,
    core.Pose,
    core.Camera,
    core.FrameContext,
)


class CoreClock:
    """Seconds spent inside the extension."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.calls = 0

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, noting its time."""

        def call(*arguments: Any, **options: Any) -> Any:
            begin = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds += time.perf_counter() - begin
                self.calls += 1

        return call

    def cost_outside(self) -> float:
        """Seconds a noted call costs outside the noted time."""
        seconds, calls = self.seconds, self.calls
        nothing = self.timed(abs)
        n = 20_000
        least = float("inf")
        for _ in range(5):
            self.seconds = 0.0
            begin = time.perf_counter()
            for _ in range(n):
                nothing(0)
            noted = time.perf_counter() - begin - self.seconds
            begin = time.perf_counter()
            for _ in range(n):
                pass
            least = min(least, noted - (time.perf_counter() - begin))
        self.seconds, self.calls = seconds, calls
        return least / n

    def install(self) -> None:
        """Replace the functions and methods of the extension, for the rest of the process."""
        for name, function in list(vars(core).items()):
            if inspect.isbuiltin(function):
                setattr(core, name, self.timed(function))
        for kind in _CLASSES:
            for name, member in list(vars(kind).items()):
                if isinstance(member, property):
                    setattr(kind, name, property(self.timed(member.fget), member.fset))
                elif name in ("__init__", "__matmul__") or (
                    not name.startswith("_") and not isinstance(member, staticmethod)
                ):
                    setattr(kind, name, self.timed(member))


@dataclass(frozen=True)
class PythonShare:
    """Medians over the frames of a sequence."""

    frames: int
    milliseconds: float
    """Of a track call."""
    python_milliseconds: float
    noting_milliseconds: float
    """Cost of the measurement, already taken off both."""
    calls: float
    """Of the extension, per frame."""

    @property
    def share(self) -> float:
        return self.python_milliseconds / self.milliseconds


def measure(folder: Path, sensor: Sensor, *, tracking_only: bool) -> PythonShare:
    """Track a sequence; with `tracking_only` leave out the frames that became keyframes."""
    sequence = open_sequence(folder, sensor)
    clock = CoreClock()
    clock.install()
    frames: list[tuple[float, float, int]] = []
    name = "track_stereo" if sensor is Sensor.STEREO else "track_rgbd"
    track = getattr(System, name)

    def timed_track(*arguments: Any, **options: Any) -> TrackingRecord:
        core_before, calls_before = clock.seconds, clock.calls
        begin = time.perf_counter()
        record: TrackingRecord = track(*arguments, **options)
        elapsed = time.perf_counter() - begin
        if not (tracking_only and record.is_keyframe):
            between = elapsed - (clock.seconds - core_before)
            frames.append((elapsed, between, clock.calls - calls_before))
        return record

    setattr(System, name, timed_track)
    images = _Loaded(sequence)
    SequenceRunner(images, sequence.settings, None, RunOptions(sensor, deterministic=True)).run()
    elapsed, between, calls = (float(value) for value in np.median(frames, axis=0))
    noting = clock.cost_outside() * calls
    return PythonShare(
        len(frames), 1e3 * (elapsed - noting), 1e3 * (between - noting), 1e3 * noting, calls
    )


class _Loaded:
    """A sequence whose images are in memory, so that no decoding thread competes."""

    def __init__(self, sequence: Any) -> None:
        self._sequence = sequence
        self._images = [sequence.load(i) for i in range(len(sequence))]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sequence, name)

    def __len__(self) -> int:
        return len(self._images)

    def load(self, index: int, /) -> Any:
        return self._images[index]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("sensor", type=Sensor)
    parser.add_argument("--tracking-only", action="store_true", help="leave out new keyframes")
    arguments = parser.parse_args()
    share = measure(arguments.folder, arguments.sensor, tracking_only=arguments.tracking_only)
    print(json.dumps({**asdict(share), "share": share.share}))


if __name__ == "__main__":
    main()
