# SPDX-License-Identifier: BSD-3-Clause
"""How much of a frame's time is Python between the C++ steps.

Every function and method of the extension that orchestration calls is replaced by one that also
notes its time; the rest of the track call is Python. Mapping runs inline (deterministic mode), so
that no other thread's use of the interpreter is counted on either side. What the noting itself
costs, and properties of extension objects, count as Python: the share is an upper bound.

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

from orbslam2py import _core as core
from orbslam2py.datasets import open_sequence
from orbslam2py.records import TrackingRecord
from orbslam2py.runner import RunOptions, SequenceRunner
from orbslam2py.sensor import Sensor
from orbslam2py.system import System

_CLASSES = (
    core.Map,
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

    def install(self) -> None:
        """Replace the functions and methods of the extension, for the rest of the process."""
        for name, function in list(vars(core).items()):
            if inspect.isbuiltin(function):
                setattr(core, name, self.timed(function))
        for kind in _CLASSES:
            for name, method in list(vars(kind).items()):
                plain = not name.startswith("_") or name == "__matmul__"
                if plain and not isinstance(method, (property, staticmethod)) and callable(method):
                    setattr(kind, name, self.timed(method))


@dataclass(frozen=True)
class PythonShare:
    """Averages over the frames of a sequence."""

    frames: int
    milliseconds: float
    """Of a track call."""
    python_milliseconds: float
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
    total, inside, calls, frames = 0.0, 0.0, 0, 0
    name = "track_stereo" if sensor is Sensor.STEREO else "track_rgbd"
    track = getattr(System, name)

    def timed_track(*arguments: Any, **options: Any) -> TrackingRecord:
        nonlocal total, inside, calls, frames
        core_before, calls_before = clock.seconds, clock.calls
        begin = time.perf_counter()
        record: TrackingRecord = track(*arguments, **options)
        elapsed = time.perf_counter() - begin
        if not (tracking_only and record.is_keyframe):
            total += elapsed
            inside += clock.seconds - core_before
            calls += clock.calls - calls_before
            frames += 1
        return record

    setattr(System, name, timed_track)
    images = _Loaded(sequence)
    SequenceRunner(images, sequence.settings, None, RunOptions(sensor, deterministic=True)).run()
    return PythonShare(frames, 1e3 * total / frames, 1e3 * (total - inside) / frames, calls / frames)


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
