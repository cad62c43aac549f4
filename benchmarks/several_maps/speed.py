# SPDX-License-Identifier: BSD-3-Clause
"""What several maps cost: merging two of them, tracking during the merge, searching, and a single
map.

Maps are made up (`benchmarks.loops.made_up_map`): a camera drives around a ring, once for each of
two maps, each with another drift.

    python -m benchmarks.several_maps.speed
    python -m benchmarks.several_maps.speed --parts merge search --repeat 20

Exits with 1 if a limit is missed. Other programs disturb the times: they mean something on an
otherwise idle computer only.
"""

from __future__ import annotations

import gc
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from rich.table import Table

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table, verdict
from benchmarks.loops.made_up_map import MadeUpMap, MapSize
from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.datasets import Images
from orbslam2py.slam.config import MergingConfig
from orbslam2py.slam.merging import MapMerging
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.vocabulary import load_vocabulary

#: Limits: seconds of joining two maps without the full adjustment after it, milliseconds for which
#: readers are locked out, and p99 of tracking during the merge divided by that without a merge.
MOST_SECONDS, MOST_LOCKED_MS, MOST_P99_RATIO = 0.5, 20.0, 2.0
#: By how much times may differ that are to be equal: of whole runs, and of searches.
NOISE, SEARCH_NOISE = 0.03, 0.1
#: Frames after the start of a run that do not count, and frames after them that do.
_WARM_UP, _COUNTED = 20, 60
#: Seconds between two looks of who notes how long readers wait.
_LOOK = 2e-4
#: Images that are searched, and keyframes that look for their place.
_SEARCHED = 100


# ---- maps ----------------------------------------------------------------------------------------
@dataclass
class Rings:
    """Two drives around rings, with words."""

    first: MadeUpMap
    second: MadeUpMap

    @staticmethod
    def make(n_keyframes: int) -> Rings:
        """Draw and extract everything."""
        vocabulary = load_vocabulary()
        rings = Rings(*(MadeUpMap.make(MapSize(n_keyframes, seed=seed)) for seed in (1, 2)))
        for frame in (*rings.first.frames, *rings.second.frames):
            core.describe(frame, vocabulary)
        return rings

    def twice(self, slam_map: core.Map, rng: np.random.Generator) -> core.Loop:
        """Two maps of one ring, and a place that is in both."""
        ids = [self.first.fill(slam_map, rng)]
        slam_map.begin_map()
        ids.append(self.first.fill(slam_map, rng))
        place = len(ids[0]) // 2
        options = core.LoopVerificationOptions(fix_scale=True)
        loop = core.verify_loop_candidate(slam_map, ids[1][place], ids[0][place], options)
        if loop is None:
            raise RuntimeError("the same image twice is not believed to be one place")
        return loop


def join(slam_map: core.Map, loop: core.Loop, timer: StageTimer) -> None:
    """Make one map of two, as the system does once it believes the place."""
    merging = MapMerging(
        slam_map, lambda *_: None, lambda _: [], fixes_scale=lambda *_: True, config=MergingConfig()
    )
    if merging.join(loop, timer, core.StopFlag()) is None:
        raise RuntimeError("the maps were not joined")


class WaitingReader:
    """Reads the map all the time in another thread, and notes how long it had to wait."""

    def __init__(self, slam_map: core.Map) -> None:
        self._map = slam_map
        self._ended = threading.Event()
        self.longest_ms = 0.0

    @contextmanager
    def reading(self) -> Iterator[WaitingReader]:
        """Read during the block."""
        thread = threading.Thread(target=self._read)
        thread.start()
        try:
            yield self
        finally:
            self._ended.set()
            thread.join()

    def _read(self) -> None:
        while not self._ended.is_set():
            begin = time.perf_counter()
            _ = self._map.n_keyframes
            self.longest_ms = max(self.longest_ms, 1e3 * (time.perf_counter() - begin))
            time.sleep(_LOOK)


# ---- joining -------------------------------------------------------------------------------------
def merge_table(rings: Rings, repeat: int) -> tuple[Table, bool]:
    """Time of each step of joining two maps, and how long readers wait for it."""
    steps: dict[str, list[float]] = {}
    totals, locked = [], []
    for number in range(repeat):
        slam_map = core.Map()
        loop = rings.twice(slam_map, np.random.default_rng(number))
        timer, reader = StageTimer(), WaitingReader(slam_map)
        gc.collect()
        if number % 2:  # who reads meanwhile takes time as well
            with reader.reading():
                join(slam_map, loop, timer)
            locked.append(reader.longest_ms)
            continue
        begin = time.perf_counter()
        join(slam_map, loop, timer)
        totals.append(time.perf_counter() - begin)
        for step, ms in timer.milliseconds.items():
            steps.setdefault(step, []).append(ms)
    n = rings.first.size.keyframes
    table = new_table(
        f"Joining two maps of {n} keyframes and {slam_map.n_points // 2} points each",
        [""],
        ["median", "longest", "limit", "met"],
        f"{len(totals)} times, and {len(locked)} times with a reader of the map",
    )
    for step, times in steps.items():
        table.add_row(f"{step}, ms", f"{statistics.median(times):.1f}", f"{max(times):.1f}", "", "")
    rows = (
        ("all of it, without the full adjustment after it, s", totals, MOST_SECONDS),
        ("longest wait of a reader, ms", locked, MOST_LOCKED_MS),
    )
    good = True
    for name, values, most in rows:
        middle = statistics.median(values)
        good &= middle < most
        table.add_row(
            name, f"{middle:.3g}", f"{max(values):.3g}", f"{most:g}", verdict(middle < most)
        )
    return table, good


# ---- tracking meanwhile --------------------------------------------------------------------------
@dataclass
class Tracked:
    """Milliseconds of track calls."""

    without: list[float] = field(default_factory=list)
    during: list[float] = field(default_factory=list)
    n_merges: int = 0


class Joiner:
    """Joins two maps of a running system in another thread; local mapping stands still."""

    def __init__(self, system: System, loop: core.Loop) -> None:
        self._back_end = system.pipeline.back_end
        self._loop = loop
        self._thread = threading.Thread(target=self._run)
        self.running = False

    def begin(self) -> None:
        """Begin."""
        self.running = True
        self._thread.start()

    def wait(self) -> None:
        """For its end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            with self._back_end.mapping.worker.pause(brief=True) as ticket:
                ticket.wait()
                join(self._back_end.map, self._loop, StageTimer())
        finally:
            self.running = False


def tracked_run(
    system: System, images: list[Images], joiner: Joiner | None, begin_at: int
) -> list[float]:
    """Track images; milliseconds of some from `begin_at` on, or of those while maps are joined."""
    times = []
    for i, image in enumerate(images):
        if i == begin_at and joiner is not None:
            joiner.begin()
        counts = i >= begin_at and (i < begin_at + _COUNTED if joiner is None else joiner.running)
        begin = time.perf_counter()
        assert image.right is not None
        system.track_stereo(image.image, image.right, i / 20.0)
        if counts:
            times.append(1e3 * (time.perf_counter() - begin))
    return times


def tracking_table(rings: Rings, images: list[Images], passes: int) -> tuple[Table, bool]:
    """Tracking's times with and without two other maps that are being joined."""
    found = Tracked()
    settings = _sequence(Sensor.STEREO, len(images)).settings
    for number in range(2 * passes):
        rng = np.random.default_rng(number)
        with System(settings, Sensor.STEREO, loop_closing=False, check_calibration=False) as system:
            slam_map = system.pipeline.back_end.map
            loop = rings.twice(slam_map, rng)
            joiner = Joiner(system, loop) if number % 2 else None
            # At another image each time, so that no single one decides.
            begin_at = _WARM_UP + 3 * (number // 2)
            times = tracked_run(system, images, joiner, begin_at)
            if joiner is None:
                found.without += times
            else:
                joiner.wait()
                found.during += times
                found.n_merges += 1
    table = new_table(
        "Tracking while two resting maps are joined",
        [""],
        ["frames", "median ms", "p95", "p99", "limit", "met"],
        f"{found.n_merges} times; frames that began while maps were being joined, and those of the "
        "same images without",
    )
    p99 = []
    for name, times in (("without", found.without), ("meanwhile", found.during)):
        values = np.percentile(times, (50, 95, 99))
        p99.append(float(values[2]))
        table.add_row(name, str(len(times)), *(f"{value:.1f}" for value in values), "", "")
    ratio = p99[1] / p99[0]
    table.add_row(
        "p99 during / without", "", "", "", f"{ratio:.2f}", f"{MOST_P99_RATIO:g}",
        verdict(ratio <= MOST_P99_RATIO),
    )  # fmt: skip
    return table, ratio <= MOST_P99_RATIO


# ---- one map -------------------------------------------------------------------------------------
def one_map_table(images: list[Images], pairs: int) -> tuple[Table, bool]:
    """Tracking and mapping with `several_maps` on and off where one map is enough, in turns."""
    settings = _sequence(Sensor.STEREO, len(images)).settings

    def run(*, several_maps: bool) -> float:
        gc.collect()
        with System(
            settings,
            Sensor.STEREO,
            deterministic=True,
            several_maps=several_maps,
            check_calibration=False,
        ) as system:
            begin = time.process_time()
            for i, image in enumerate(images):
                assert image.right is not None
                system.track_stereo(image.image, image.right, i / 20.0)
            return time.process_time() - begin

    run(several_maps=True)  # the first one loads and warms up
    ratios: list[float] = []
    seconds: dict[bool, list[float]] = {True: [], False: []}
    for number in range(pairs):
        order = (True, False) if number % 2 else (False, True)
        taken = {several: run(several_maps=several) for several in order}
        for several, value in taken.items():
            seconds[several].append(value)
        ratios.append(taken[True] / taken[False])
    ratio = statistics.median(ratios)
    table = new_table(
        f"One map: several maps allowed or not ({pairs} pairs of {len(images)} frames)",
        [""],
        ["on, s", "off, s", "ratio", "least", "most", "limit", "met"],
        "Processor time of tracking, mapping and loop closing, deterministic, in turns.",
    )
    table.add_row(
        "stereo, 480 x 360",
        *(f"{statistics.median(seconds[several]):.2f}" for several in (True, False)),
        *(f"{value:.3f}" for value in (ratio, min(ratios), max(ratios))),
        f"1 + {NOISE:g}", verdict(ratio <= 1 + NOISE),
    )  # fmt: skip
    return table, ratio <= 1 + NOISE


# ---- searching -----------------------------------------------------------------------------------
def search_table(rings: Rings, repeat: int) -> tuple[Table, bool]:
    """Searching two maps, against one map that holds all of it."""
    vocabulary = load_vocabulary()
    strangers = MadeUpMap.make(MapSize(_SEARCHED, seed=3)).frames
    for frame in strangers:
        core.describe(frame, vocabulary)
    stores = {several: _indexed(rings, several=several) for several in (False, True)}
    taken: dict[tuple[str, bool], list[float]] = {}
    for number in range(2 * repeat):
        several = number % 2 == 1
        slam_map, index, keyframes = stores[several]
        begin = time.perf_counter()
        for frame in strangers:
            core.find_relocalization_candidates(index, slam_map, frame)
        middle = time.perf_counter()
        for keyframe in keyframes:
            core.find_loop_candidates(index, slam_map, keyframe, 0.0)
        end = time.perf_counter()
        taken.setdefault(("a lost frame", several), []).append(middle - begin)
        taken.setdefault(("a keyframe's place", several), []).append(end - middle)
    n = stores[True][0].n_keyframes
    table = new_table(
        f"Searching {n} keyframes in two maps or in one ({repeat} times in turns, least times)",
        ["searched for"],
        ["two maps, ms", "one map, ms", "ratio", "limit", "met"],
        f"Mean of {_SEARCHED} searches by words.",
    )
    good = True
    for name in ("a lost frame", "a keyframe's place"):
        two, one = (1e3 * min(taken[name, several]) / _SEARCHED for several in (True, False))
        met = two / one <= 1 + SEARCH_NOISE
        good &= met
        table.add_row(
            name,
            f"{two:.3f}",
            f"{one:.3f}",
            f"{two / one:.3f}",
            f"1 + {SEARCH_NOISE:g}",
            verdict(met),
        )
    return table, good


def _indexed(rings: Rings, *, several: bool) -> tuple[core.Map, core.KeyFrameIndex, list[int]]:
    """Both rings in one map, or in two; some keyframes of the second."""
    slam_map, index = core.Map(), core.KeyFrameIndex()
    rng = np.random.default_rng(0)
    ids = rings.first.fill(slam_map, rng)
    if several:
        slam_map.begin_map()
    ids += rings.second.fill(slam_map, rng)
    for keyframe in ids:
        core.index_keyframe(index, slam_map, keyframe)
    return slam_map, index, ids[-_SEARCHED:]


# ---- command line --------------------------------------------------------------------------------
def _sequence(sensor: Sensor, n_frames: int) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(
            world="corridor", sensor=sensor, frames=n_frames, size=(480, 360), speed=1.0
        )
    )


PARTS = ("merge", "tracking", "one-map", "search")


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = new_parser(__doc__)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="[all]")
    add_counts(
        parser,
        keyframes=(500, "of each map"),
        repeat=(8, "how often maps are joined and searched"),
        passes=(10, "runs of each kind while maps are joined"),
        pairs=(5, "of runs with one map"),
        frames=(160, "of a run"),
    )
    add_width(parser)
    given = parser.parse_args(arguments)
    if given.frames <= _WARM_UP + 3 * given.passes:
        parser.error(f"--frames must be more than {_WARM_UP + 3 * given.passes}")
    if given.repeat < 2:
        parser.error("--repeat must be at least 2")
    console = console_of(given)
    rings = Rings.make(given.keyframes) if set(given.parts) - {"one-map"} else None
    images: list[Images] = []
    if {"tracking", "one-map"} & set(given.parts):
        sequence = _sequence(Sensor.STEREO, given.frames)
        images = [sequence.load(i) for i in range(given.frames)]
    good = True
    for part in given.parts:
        if part == "one-map":
            table, met = one_map_table(images, given.pairs)
        else:
            assert rings is not None
            if part == "merge":
                table, met = merge_table(rings, given.repeat)
            elif part == "tracking":
                table, met = tracking_table(rings, images, given.passes)
            else:
                table, met = search_table(rings, given.repeat)
        console.print(table)
        good &= met
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
