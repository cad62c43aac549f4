# SPDX-License-Identifier: BSD-3-Clause
"""Tracking in real time while full adjustments of a large map run, one after the other.

A stereo camera goes along a corridor; the images are rendered before. Its system's map holds a
made-up ring of keyframes already, under which the live ones hang. In every second run
`System.optimize` refines everything without a pause; before each adjustment the ring drifts anew.
Both kinds of runs see the same images, in turns.

    python -m benchmarks.loops.tracking --passes 3
"""

from __future__ import annotations

import json
import statistics
import threading
import time
from dataclasses import asdict, dataclass, field

import numpy as np
from rich.table import Table

from benchmarks.harness import reference
from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table, verdict
from benchmarks.loops.made_up_map import MadeUpMap, MapSize
from orbslam2py import FullAdjustmentRecord, Sensor, System, TrackingState
from orbslam2py import _core as core
from orbslam2py.datasets import Images
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence, SyntheticWorld

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
            self._system.pipeline.back_end.map.set_pose(keyframe, pose)
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


def hang_under(system: System, ring: list[int]) -> None:
    """Make the live map a part of the ring's."""
    slam_map = system.pipeline.back_end.map
    assert system.wait_until_idle()
    live = core.snapshot_keyframes(slam_map).ids.tolist()
    slam_map.join_maps(live[0], ring[0])
    slam_map.set_parent(live[0], ring[0])


def track_all(
    system: System, images: list[Images], period: float, ring: list[int], adjuster: Adjuster | None
) -> tuple[list[float], int]:
    """Milliseconds of the frames that count, and how many frames were tracked."""
    times, tracked = [], 0
    begin = time.perf_counter()
    for i, image in enumerate(images):
        # Tracking begins a map of its own.
        if i == _WARM_UP:
            hang_under(system, ring)
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
            ring = made.fill(system.pipeline.back_end.map, rng)
            adjuster = Adjuster(system, made, ring, rng) if number % 2 else None
            times, tracked = track_all(system, images, period, ring, adjuster)
            result.tracked += tracked
            result.frames += n_frames
            if adjuster is None:
                result.without_ms += times
                continue
            result.during_ms += times
            for seconds, record in adjuster.done:
                assert record.n_keyframes >= size.keyframes, "the ring is in the live map"
                result.add(seconds, record)
            adjuster.wait()  # this one had no tracking beside it to its end
    return result


# ---- what is shown -------------------------------------------------------------------------------
def tracking_table(found: Measured) -> Table:
    """Tracking's times with and without full adjustments beside it, and theirs beside tracking."""
    seconds = found.adjustment_s
    table = new_table(
        f"Tracking in real time (every {found.period_ms:.0f} ms) while the map of "
        f"{found.keyframes} keyframes and {found.points} points is adjusted",
        [""],
        ["measured", "limit", "met"],
        f"{len(found.without_ms)} and {len(found.during_ms)} frames of the same images; "
        f"{found.tracked} of {found.frames} tracked\n{len(seconds)} adjustments to their "
        f"end, {found.used} used; accepted steps: {found.iterations}\n"
        "Other programs disturb the ratio: it means something on an otherwise idle computer only.",
    )
    p99 = []
    for name, times in (("without", found.without_ms), ("meanwhile", found.during_ms)):
        values = np.percentile(times, (50, 95, 99))
        p99.append(float(values[2]))
        shown = " / ".join(f"{value:.1f}" for value in values)
        table.add_row(f"track ms {name}: median / p95 / p99", shown, "", "")
        table.add_row(f"track ms {name}: longest", f"{max(times):.1f}", "", "")
    ratio, most = p99[1] / p99[0], reference.ADJUSTMENT_TRACKING_RATIO
    table.add_row("p99 during / without", f"{ratio:.2f}", f"{most:g}", verdict(ratio <= most))
    limit = (reference.LOOPS["full_adjustment"].limit or 0) / 1e3
    if seconds:
        shown = f"{statistics.median(seconds):.1f} ({max(seconds):.1f})"
        met = verdict(max(seconds) < limit)
        table.add_row("full adjustment s: median (longest)", shown, f"{limit:g}", met)
    for step, times in found.steps_ms.items():
        shown = f"{statistics.median(times):.1f} ({max(times):.1f})"
        table.add_row(f"of it {step} ms: median (longest)", shown, "", "")
    return table


# ---- command line --------------------------------------------------------------------------------
def main() -> None:
    parser = new_parser(__doc__)
    add_counts(
        parser,
        passes=(2, "runs of each kind"),
        frames=(300, "frames of a run"),
        keyframes=(1000, "keyframes of the made-up map"),
    )
    parser.add_argument("--json", action="store_true", help="print everything as JSON")
    add_width(parser)
    arguments = parser.parse_args()
    if arguments.frames <= _WARM_UP:
        parser.error(f"--frames must be more than {_WARM_UP}")
    found = measure(MapSize(arguments.keyframes), arguments.frames, arguments.passes)
    if arguments.json:
        print(json.dumps(asdict(found)))
    else:
        console_of(arguments).print(tracking_table(found))


if __name__ == "__main__":
    main()
