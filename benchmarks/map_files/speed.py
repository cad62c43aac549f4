# SPDX-License-Identifier: BSD-3-Clause
"""Map files of large maps: size, time and memory of saving and loading.

    python -m benchmarks.map_files.speed

Made-up maps: keyframes of 1000 random features, points that six keyframes in a row see. Times are
medians of five, the first load apart. Of the largest map only the load is measured.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.harness.arguments import add_counts, new_parser
from benchmarks.harness.process_memory import peak_mb, resident_mb
from benchmarks.map_files.mapping import corridor, made_up, mapped
from orbslam2py import System, load_vocabulary
from orbslam2py import _core as core
from orbslam2py.maps import MapFile, SavedMap, load_map, restore_contents, save_map, take_contents
from orbslam2py.maps.map_copies import take_changes
from orbslam2py.maps.map_rows import all_rows, keypoint_rows, map_rows
from orbslam2py.maps.map_writer import MapWriter


def seconds_of(step: Callable[[], object], repeats: int = 5) -> float:
    """Median time of a step."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        step()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def longest_wait(slam_map: core.Map) -> tuple[float, float]:
    """How long a copy of the whole map takes, and how long it keeps a writer waiting at most."""
    waits, done = [], threading.Event()

    def write() -> None:
        while not done.is_set():
            begin = time.perf_counter()
            slam_map.set_position(0, np.zeros(3))
            waits.append(time.perf_counter() - begin)
            time.sleep(0.0005)

    writer = threading.Thread(target=write)
    writer.start()
    copy = seconds_of(lambda: take_contents(slam_map))
    done.set()
    writer.join()
    return copy, max(waits)


def increment(path: Path, slam_map: core.Map, saved: SavedMap) -> float:
    """Seconds of the commit of one new keyframe, and of 500 points that moved with it."""
    ids = saved.contents.keyframes.ids
    points = saved.contents.points.ids[-500:].tolist()
    times = []
    with contextlib.closing(MapWriter(path)) as writer:
        before = take_changes(slam_map, ids[:0], None)
        late = set(ids[-5:].tolist())
        rows = all_rows(saved)
        writer.commit(row for row in rows if row[0] != "keypoints" or row[1][0] not in late)
        for newest in range(len(ids) - 5, len(ids)):
            for point in points:
                slam_map.set_position(point, slam_map.point_position(point) + 0.001)
            known = np.delete(ids, newest)
            begin = time.perf_counter()
            before = take_changes(slam_map, known, before)
            pages = set(zip(before.pages.tolist(), strict=True))
            new = [*map_rows(before.contents, before.changed_keyframes)]
            new += keypoint_rows(before.contents, [newest])
            kept = {
                table: writer.keys(table) - (pages if "keyframe" not in table else set())
                for table in ("keyframes", "covisibility", "map_points", "observations")
            }
            writer.commit(new, kept)
            times.append(time.perf_counter() - begin)
    return statistics.median(times)


def frames_with_autosave(folder: Path, frames: int) -> tuple[float, float]:
    """p99 of the track calls [ms] without and with autosave every second, in real time."""
    result = []
    sequence = corridor(frames, (640, 480))
    images = [sequence.load(i) for i in range(frames)]
    for saving in (False, True):
        with System(sequence.settings, "rgbd") as slam:
            if saving:
                slam.autosave(folder / "autosave.orbmap", every=1.0)
            times = []
            begin = time.perf_counter()
            for image, t in zip(images, sequence.timestamps - sequence.timestamps[0], strict=True):
                time.sleep(max(0.0, begin + float(t) - time.perf_counter()))
                record = slam.track_rgbd(image.image, image.depth, float(t))
                times.append(record.milliseconds["track"])
        result.append(float(np.percentile(times, 99)))
    return result[0], result[1]


def print_autosave(folder: Path, frames: int, n_pairs: int) -> None:
    """Print what autosave costs tracking, in pairs of runs."""
    pairs = [frames_with_autosave(folder, frames) for _ in range(n_pairs)]
    without, with_it = (statistics.median(pair[i] for pair in pairs) for i in (0, 1))
    ratio = statistics.median(after / before for before, after in pairs)
    print(
        f"track calls in real time, p99: {without:.2f} ms, with autosave every second "
        f"{with_it:.2f} ms; median of the ratios of {n_pairs} pairs {ratio:.2f}"
    )


def memory_of_load(path: Path) -> None:
    """Print the memory of a map, and the peak while it was loaded (in a separate process)."""
    vocabulary = load_vocabulary()
    gc.collect()
    before = resident_mb(trimmed=True)
    slam_map, index = core.Map(), core.KeyFrameIndex()
    begin = time.perf_counter()
    MapFile(path).restore(slam_map, vocabulary, index)
    seconds = time.perf_counter() - begin
    peak = peak_mb() - before
    gc.collect()
    size = resident_mb(trimmed=True) - before
    print(
        f"{len(index)} keyframes: load until usable {seconds:.2f} s; map {size:.0f} MB, on the "
        f"way at most {peak:.0f} MB, {peak / size:.2f} times"
    )


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(
        parser,
        keyframes=(1000, "keyframes"),
        features=(1000, "features of each"),
        points=(60_000, "points"),
        largest=(10_000, "keyframes of the largest map; 0: none"),
        frames=(300, "frames of the runs with autosave; 0: none"),
        pairs=(5, "runs with autosave, and without"),
    )
    parser.add_argument("--load", type=Path, help="measure the load of this file alone")
    arguments = parser.parse_args()
    if arguments.load is not None:
        memory_of_load(arguments.load)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "large.orbmap"
        print_size_and_times(arguments, path)
        command = [sys.executable, "-m", "benchmarks.map_files.speed", "--load", str(path)]
        subprocess.run(command, check=True)
        if arguments.largest:
            points = arguments.points * arguments.largest // arguments.keyframes
            save_map(made_up(mapped(20), arguments.largest, arguments.features, points), path)
            subprocess.run(command, check=True)
        if arguments.frames:
            print_autosave(folder, arguments.frames, arguments.pairs)


def print_size_and_times(arguments: argparse.Namespace, path: Path) -> None:
    saved = made_up(mapped(20), arguments.keyframes, arguments.features, arguments.points)
    raw = sum(array.nbytes for _, array in saved.contents.arrays())
    save = seconds_of(lambda: save_map(saved, path))
    size = path.stat().st_size
    print(f"file {size / 1e6:.1f} MB, {size / raw:.3f} times the arrays; saved in {save:.2f} s")
    print(f"read and checked in {seconds_of(lambda: load_map(path), 3):.2f} s")
    slam_map = restore_contents(saved.contents)
    copy, wait = longest_wait(slam_map)
    print(f"copied in {1e3 * copy:.0f} ms; a writer waits at most {1e3 * wait:.1f} ms")
    print(f"one more keyframe: {1e3 * increment(path, slam_map, saved):.1f} ms", flush=True)


if __name__ == "__main__":
    main()
