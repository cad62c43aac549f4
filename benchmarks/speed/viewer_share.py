# SPDX-License-Identifier: BSD-3-Clause
"""What watching takes in the process that tracks, as processor time: also a busy machine tells it.

A map of 5000 keyframes and 500 000 points is mapped further while it is followed five times a
second; a recorded sequence is tracked in real time while its images are shown. And what nobody pays
who does not watch.

    python -m benchmarks.speed.viewer_share [--seconds 10]
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import threading
import time
import timeit
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import orbslam2py as orb
from benchmarks.harness.arguments import add_width, console_of, new_parser
from benchmarks.harness.folders import MISSING, sequence_folder, shared_folder
from benchmarks.harness.onlooker import Onlooker
from benchmarks.harness.tables import in_words, new_table, verdict
from orbslam2py import _core as core
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.viewer import LiveView, Publisher
from orbslam2py.viewer.live import FRAME_RATE

#: Of one core, for following a large map.
TARGET = 0.05
#: Of the time of an image or an import, without a viewer.
UNCHANGED = 0.01
KEYFRAMES, NEW_POINTS, OBSERVERS = 5000, 100, 8
#: Keyframes that a local bundle adjustment moves, with their points.
_LOCAL = 25
#: Keyframes a second while it is mapped.
_RATE = 5.0
_SEQUENCES = (
    ("7scenes_redkitchen_head250", "rgbd", 30.0),
    ("kitti_06_head51_stereo", "stereo", 10.0),
)


@dataclass(frozen=True)
class Share:
    """Seconds of processor for a second."""

    tracking_process: float
    """Of the process that tracks, for the viewer alone."""
    page_process: float
    looks: float
    """Changes of the map that were handed over, a second."""


# ---- a large map ---------------------------------------------------------------------------------
@dataclass
class StraightMap:
    """A camera that goes straight on: every keyframe brings points, which the next seven see."""

    slam_map: core.Map
    frame: core.Frame
    points: list[list[int]] = field(default_factory=list)

    def add_keyframe(self) -> None:
        """As mapping does: a keyframe, its new points, and observations of those before."""
        k = len(self.points)
        slam_map = self.slam_map
        keyframe = slam_map.add_keyframe(self.frame, _pose(k))
        self.points.append(
            [slam_map.add_point([k, 0.1 * i, 5.0], keyframe, k) for i in range(NEW_POINTS)]
        )
        for maker in range(max(0, k + 1 - OBSERVERS), k + 1):
            slot = (maker % OBSERVERS) * NEW_POINTS
            for i, point in enumerate(self.points[maker]):
                slam_map.add_observation(point, keyframe, slot + i)
        slam_map.update_connections(keyframe)
        slam_map.publish(keyframe)

    def adjust(self) -> None:
        """Move what is around the newest keyframe."""
        first = len(self.points) - _LOCAL
        for k, points in enumerate(self.points[first:], first):
            self.slam_map.set_pose(k, _pose(k))
            for i, point in enumerate(points):
                self.slam_map.set_position(point, [k, 0.1 * i, 5.001])


def _pose(k: float) -> core.Pose:
    T_cw = np.eye(4)
    T_cw[0, 3] = -k
    return core.Pose.from_matrix(T_cw)


def _any_frame() -> core.Frame:
    """With a keypoint for every observation."""
    image = np.random.default_rng(0).integers(0, 255, (480, 640), np.uint8)
    options = core.CameraOptions(
        fx=400, fy=400, cx=320, cy=240, width=640, height=480, bf=200, depth_ratio=200
    )
    context = core.FrameContext(core.Camera(options), core.ScalePyramid(1.2, 8))
    extraction = core.OrbExtractor(core.OrbOptions(n_features=1200, n_levels=8)).extract(image)
    depth = np.full(image.shape, 5, np.float32)
    frame = core.build_rgbd_frame(context, 0, 0.0, extraction, depth)
    assert len(frame.keypoints) >= OBSERVERS * NEW_POINTS
    return frame


def follow_large_map(seconds: float) -> Share:
    """Continue mapping for a while, with a client of the viewer."""
    with orb.System("tum1", "rgbd") as system:
        large = StraightMap(system.pipeline.back_end.map, _any_frame())
        for _ in range(KEYFRAMES):
            large.add_keyframe()
        with _watched(system) as measured:
            large.add_keyframe()

            def map_on() -> None:
                large.add_keyframe()
                large.adjust()

            return measured(map_on, 1 / _RATE, round(seconds * _RATE))


# ---- images --------------------------------------------------------------------------------------
def show_images(folder: Path, sensor: str, rate: float) -> Share:
    """Track a sequence in real time, with a client of the viewer."""
    sequence = orb.open_sequence(folder, sensor)
    frames = iter([(frame.images, frame.timestamp) for frame in sequence])
    with orb.System(sequence.settings, sensor) as system:

        def track() -> None:
            images, timestamp = next(frames)
            if images.depth is not None:
                system.track_rgbd(images.image, images.depth, timestamp)
            else:
                assert images.right is not None
                system.track_stereo(images.image, images.right, timestamp)

        with _watched(system, sequence.ground_truth()) as measured:
            return measured(track, 1 / rate, len(sequence))


# ---- measuring -----------------------------------------------------------------------------------
Measure = Callable[[Callable[[], None], float, int], Share]


@contextmanager
def _watched(system: orb.System, truth: orb.Trajectory | None = None) -> Iterator[Measure]:
    """Let somebody look; yields what does something at a rate, and measures the viewer alone."""
    view = LiveView(port=0)
    view.attach(system, truth=truth)
    clock, looks = _Clock(), _Clock()
    view.on_map = looks.timed(view.on_map)  # type: ignore[method-assign]
    try:
        with Onlooker(view.address), Publisher(system, [view], frame_rate=FRAME_RATE):
            # What the viewer does in threads that do other things as well.
            watch = system.pipeline.frame_watchers[0]
            system.pipeline.frame_watchers = (clock.timed(watch),)
            system.trajectory = clock.timed(system.trajectory)  # type: ignore[method-assign]

            def measured(work: Callable[[], None], period: float, times: int) -> Share:
                begin = time.perf_counter()
                n_before = looks.n_calls
                before = clock.seconds + _viewer_threads(), _seconds_of(view.process_id)
                for n in range(times):
                    work()
                    time.sleep(max(0.0, begin + (n + 1) * period - time.perf_counter()))
                after = clock.seconds + _viewer_threads(), _seconds_of(view.process_id)
                elapsed = time.perf_counter() - begin
                return Share(
                    (after[0] - before[0]) / elapsed,
                    (after[1] - before[1]) / elapsed,
                    (looks.n_calls - n_before) / elapsed,
                )

            yield measured
            system.pipeline.frame_watchers = (watch,)
    finally:
        view.stop()


class _Clock:
    """Adds up the processor time of functions, and counts their calls."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.n_calls = 0

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            begin = time.thread_time()
            self.n_calls += 1
            try:
                return function(*arguments)
            finally:
                self.seconds += time.thread_time() - begin

        return call


def _viewer_threads() -> float:
    """Processor seconds of the threads that are the viewer's alone."""
    return sum(
        time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
        for thread in threading.enumerate()
        if thread.name in ("viewer publisher", "viewer page") and thread.ident is not None
    )


def _seconds_of(process: int) -> float:
    """Processor seconds of another process."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


# ---- without a viewer ----------------------------------------------------------------------------
def unwatched_share() -> tuple[float, float]:
    """Additional seconds per image because a client may connect, and total seconds per image."""
    sequence = SyntheticSequence(SyntheticOptions(sensor="rgbd", frames=10))
    with orb.System(sequence.settings, "rgbd", deterministic=True) as system:
        begin = time.thread_time()
        system.run(sequence)
        image = (time.thread_time() - begin) / len(sequence)
        pipeline = system.pipeline

        def look() -> None:  # as in `Pipeline.process`
            watchers = pipeline.frame_watchers
            bool(watchers)
            for _ in watchers:
                pass

        return min(timeit.repeat(look, number=10_000, repeat=5)) / 10_000, image


def imported_without() -> tuple[float, list[str]]:
    """Seconds of ``import orbslam2py``, and what is loaded of the viewer or for it."""
    code = (
        "import sys, time; begin = time.perf_counter(); import orbslam2py; "
        "print(time.perf_counter() - begin, *(name for name in sys.modules if name.split('.')[0] "
        "in ('viser', 'websockets', 'multiprocessing') or 'orbslam2py.viewer' in name))"
    )
    runs = [
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(7)
    ]
    return statistics.median(float(run[0]) for run in runs), runs[0][1:]


# ---- tables --------------------------------------------------------------------------------------
def share_tables(seconds: float) -> Iterator[object]:
    """What watching costs, and what not watching does."""
    table = new_table(
        "Watching: processor time in the process that tracks, and in that of the page",
        ["what"],
        [
            "of a core\ntracking process",
            "page's process",
            "looks at the\nmap a second",
            "target",
            "met",
        ],
        "Who looks takes all that a browser takes, at this computer, and draws nothing.",
    )
    share = follow_large_map(seconds)
    table.add_row(
        f"map of {KEYFRAMES} keyframes and {KEYFRAMES * NEW_POINTS} points, {_RATE:g} keyframes "
        "and looks a second",
        f"{100 * share.tracking_process:.1f} %",
        f"{100 * share.page_process:.0f} %",
        f"{100 * TARGET:g} %",
        verdict(share.tracking_process <= TARGET),
    )
    for name, sensor, rate in _SEQUENCES if shared_folder() is not None else ():
        share = show_images(sequence_folder(name), sensor, rate)
        table.add_row(
            f"{name}, {rate:g} images a second in real time",
            f"{100 * share.tracking_process:.1f} %",
            f"{100 * share.page_process:.0f} %",
            f"{share.looks:.1f}",
            "",
            "",
        )
    yield table
    if shared_folder() is None:
        yield f"[yellow]Images that are shown: left out, {MISSING}"
    more, image = unwatched_share()
    imported, loaded = imported_without()
    yield (
        f"Without a viewer: {1e9 * more:.0f} ns an image, {100 * more / image:.4f} % of one "
        f"({in_words(more / image < UNCHANGED)}); import orbslam2py in {1e3 * imported:.1f} ms "
        f"loads {', '.join(loaded) or 'nothing'} of it ({in_words(not loaded)})"
    )


def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="that the large map is mapped")
    add_width(parser)
    arguments = parser.parse_args()
    console = console_of(arguments)
    for table in share_tables(arguments.seconds):
        console.print(table)


if __name__ == "__main__":
    main()
