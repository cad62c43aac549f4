# SPDX-License-Identifier: BSD-3-Clause
"""Tracking in real time while full adjustments of a large map run, one after the other.

A stereo camera goes along a corridor; the images are rendered before. Its system's map holds a
made-up ring of keyframes already, under which the live ones hang. In every second run
`System.optimize` refines everything without a pause; before each adjustment the ring drifts anew.
Both kinds of runs see the same images, in turns.

    python -m benchmarks.loops.tracking --passes 3
"""

from __future__ import annotations

import argparse
import json
import threading
import time
from dataclasses import asdict, dataclass, field

import numpy as np

from benchmarks.loops.made_up_map import MadeUpMap, MapSize
from orbslam2py.datasets import Images
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord
from orbslam2py.slam.records import TrackingState
from orbslam2py.slam.system import System
from orbslam2py.synthetic.sequence import SyntheticOptions, SyntheticSequence, SyntheticWorld

#: Frames after the start of a run that do not count: the map begins.
_WARM_UP = 20


@dataclass
class Measured:
    """What the runs gave."""

    without_ms: list[float] = field(default_factory=list)
    """Of each track call."""
    during_ms: list[float] = field(default_factory=list)
    """Of those that began while an adjustment ran."""
    adjustment_s: list[float] = field(default_factory=list)
    """From the call of `optimize` to its end."""
    steps_ms: dict[str, list[float]] = field(default_factory=dict)
    """Of the adjustments, by step."""
    keyframes: int = 0
    points: int = 0
    iterations: list[int] = field(default_factory=list)
    used: int = 0
    tracked: int = 0
    frames: int = 0
    period_ms: float = 0.0

    def add(self, seconds: float, record: FullAdjustmentRecord) -> None:
        """Note an adjustment that ran to its end."""
        self.adjustment_s.append(seconds)
        self.iterations.append(record.iterations)
        self.used += record.used
        self.keyframes, self.points = record.n_keyframes, record.n_points
        for step, ms in record.milliseconds.items():
            self.steps_ms.setdefault(step, []).append(ms)


class Adjuster:
    """Adjusts in another thread, as a user's thread would."""

    def __init__(
        self, system: System, made: MadeUpMap, ring: list[int], rng: np.random.Generator
    ) -> None:
        self._system, self._made, self._ring, self._rng = system, made, ring, rng
        self._thread: threading.Thread | None = None
        self.done: list[tuple[float, FullAdjustmentRecord]] = []

    @property
    def running(self) -> bool:
        """An adjustment has begun and not ended."""
        return self._thread is not None and self._thread.is_alive()

    def begin(self) -> None:
        """Let the ring drift, and begin one."""
        poses = self._made.drifted(self._rng)
        for keyframe, pose in zip(self._ring, poses, strict=True):
            self._system._map.set_pose(keyframe, pose)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def wait(self) -> None:
        """For the end of the one that runs."""
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        begin = time.perf_counter()
        record = self._system.optimize()
        self.done.append((time.perf_counter() - begin, record))


def track_all(
    system: System, images: list[Images], period: float, adjuster: Adjuster | None
) -> tuple[list[float], int]:
    """Milliseconds of the frames that count, and how many frames were tracked."""
    times, tracked = [], 0
    begin = time.perf_counter()
    for i, image in enumerate(images):
        # Between two frames, so that making the drift disturbs none.
        if i >= _WARM_UP and adjuster is not None and not adjuster.running:
            adjuster.begin()
        wait = begin + i * period - time.perf_counter()
        if wait > 0:
            time.sleep(wait)
        counts = i >= _WARM_UP and (adjuster is None or adjuster.running)
        start = time.perf_counter()
        record = system.track_stereo(image.image, image.right, i * period)
        if counts:
            times.append(1e3 * (time.perf_counter() - start))
        tracked += record.state is TrackingState.OK
    return times, tracked


def measure(size: MapSize, n_frames: int, passes: int) -> Measured:
    """All runs."""
    sequence = SyntheticSequence(
        SyntheticOptions(
            world=SyntheticWorld.CORRIDOR,
            sensor=Sensor.STEREO,
            frames=n_frames,
            size=(480, 360),
            speed=1.0,
        )
    )
    images = [sequence.load(i) for i in range(n_frames)]
    period = float(sequence.timestamps[1] - sequence.timestamps[0])
    made = MadeUpMap.make(size)
    result = Measured(period_ms=1e3 * period)
    for number in range(2 * passes):
        rng = np.random.default_rng(number)
        with System(sequence.settings, Sensor.STEREO, loop_closing=False) as system:
            ring = made.fill(system._map, rng)
            adjuster = Adjuster(system, made, ring, rng) if number % 2 else None
            times, tracked = track_all(system, images, period, adjuster)
            result.tracked += tracked
            result.frames += n_frames
            if adjuster is None:
                result.without_ms += times
                continue
            result.during_ms += times
            for seconds, record in adjuster.done:
                result.add(seconds, record)
            adjuster.wait()  # this one had no tracking beside it to its end
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--passes", type=int, default=2, help="runs of each kind")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--keyframes", type=int, default=1000)
    parser.add_argument("--json", action="store_true", help="print everything as JSON")
    arguments = parser.parse_args()
    result = measure(MapSize(arguments.keyframes), arguments.frames, arguments.passes)
    if arguments.json:
        print(json.dumps(asdict(result)))
        return
    for name, times in (("without", result.without_ms), ("during", result.during_ms)):
        median, p95, p99 = np.percentile(times, (50, 95, 99))
        print(
            f"{name}: {len(times)} frames, median {median:.2f} ms, p95 {p95:.2f}, p99 {p99:.2f}, "
            f"max {max(times):.2f}"
        )
    ratio = np.percentile(result.during_ms, 99) / np.percentile(result.without_ms, 99)
    print(f"ratio of p99: {ratio:.2f}; {result.tracked} of {result.frames} frames tracked")
    seconds = ", ".join(f"{s:.2f}" for s in result.adjustment_s)
    print(
        f"adjustments of {result.keyframes} keyframes and {result.points} points: {seconds} s, "
        f"steps {result.iterations}, {result.used} used"
    )
    print({step: [round(ms, 1) for ms in times] for step, times in result.steps_ms.items()})


if __name__ == "__main__":
    main()
