# SPDX-License-Identifier: BSD-3-Clause
"""How well lost frames are found again, and that foreign ones are not.

    python -m benchmarks.accuracy.relocalization PART

    kidnap          to another place, black images between
    gaps            the camera moves behind a covered lens, or while images are blurred recall
    viewpoints beside the path, other exposure foreign         worlds and photographs never mapped
    localization    out of the map and back, ten times speed           single attempts, query of a
    large map

Errors are taken through the nearest mapped keyframe, so that the drift of the map does not count;
with a single camera lengths are those of the mapped path aligned by Sim(3).
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import cv2
import numpy as np

from benchmarks.accuracy.mapped_world import MappedWorld, beside
from benchmarks.harness.arguments import add_counts, add_sensors, new_parser
from benchmarks.harness.folders import shared_folder
from benchmarks.harness.process_memory import peak_mb, resident_mb
from benchmarks.harness.tables import in_words
from benchmarks.harness.yardstick import milliseconds_of
from orbslam2py import Reason, Sensor, System, TrackingState, load_vocabulary
from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.datasets import Images
from orbslam2py.evaluation import PoseError
from orbslam2py.slam.config import RelocalizationConfig
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.slam.relocalization import Relocalizer
from orbslam2py.slam.state import LostSearch
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence, SyntheticWorld

#: Both views had enough matches, and a reconstruction was tried.
ATTEMPTED = {Reason.LOW_PARALLAX, Reason.AMBIGUOUS_MOTION, Reason.DEGENERATE_VIEWS}
#: Metres: a frame that is found farther away was found at another place that looks alike.
WRONG = 1.0


def sequence_of(arguments: argparse.Namespace, sensor: str, **options: object) -> SyntheticSequence:
    merged = {"world": arguments.world, "noise": 2.0, "size": arguments.size} | options
    return SyntheticSequence(SyntheticOptions(sensor=sensor, **merged), threads=2)


def mapped(arguments: argparse.Namespace, sensor: str) -> MappedWorld:
    sequence = sequence_of(arguments, sensor)
    n_frames = min(arguments.frames or len(sequence), len(sequence) - 1)
    world = MappedWorld(sequence, range(n_frames), arguments.seed)
    print(
        f"{sensor}, {arguments.world}: {world.n_tracked} of {n_frames} frames tracked, "
        f"{world.system.n_keyframes} keyframes, {world.metres_per_unit:.3f} m a unit",
        flush=True,
    )
    return world


def summary(errors: list[PoseError]) -> str:
    if not errors:
        return "no poses"
    metres = np.array([e.translation_m for e in errors])
    degrees = np.array([e.rotation_deg for e in errors])
    return (
        f"{metres.mean() * 100:.2f} cm {degrees.mean():.2f} deg (mean), "
        f"{np.median(metres) * 100:.2f} cm {np.median(degrees):.2f} deg (median), "
        f"{metres.max() * 100:.2f} cm {degrees.max():.2f} deg (most); "
        f"{sum(e.is_within(0.02, 0.5) for e in errors)} of {len(errors)} within 2 cm and 0.5 deg"
    )


# ---- kidnapped -----------------------------------------------------------------------------------
def kidnap(arguments: argparse.Namespace, sensor: str) -> None:
    """Black images, then the path from another place on, a little beside it."""
    world = mapped(arguments, sensor)
    beside_path = sequence_of(arguments, sensor, lateral=0.05, yaw=3.0)
    rng = np.random.default_rng(arguments.seed)
    waits: Counter[object] = Counter()
    first_errors, all_errors = [], []
    for _ in range(arguments.count):
        world.lose(8)
        start = int(rng.integers(5, world.n_frames - 15))
        found = None
        for k in range(15):
            T_wc = beside_path.T_wc(start + k)
            record = world.show(beside_path.load(start + k))
            if record.state is TrackingState.OK:
                error = world.error(record, T_wc)
                if found is None:
                    found = k
                    first_errors.append(error)
                all_errors.append(error)
        waits[found] += 1
    print(f"  frames until found: {dict(sorted(waits.items(), key=str))}")
    print(f"  first pose  {summary(first_errors)}")
    print(f"  all poses   {summary(all_errors)}", flush=True)


# ---- gaps ----------------------------------------------------------------------------------------
def gaps(arguments: argparse.Namespace, sensor: str) -> None:
    """Places behind the mapped part of the path, reached without visible images."""
    n_gaps, second = arguments.count, 20
    for kind in ("covered", "blurred"):
        for length in (5, 10, 20):
            sequence = sequence_of(arguments, sensor)
            n_mapped = arguments.frames or 120
            world = MappedWorld(sequence, range(n_mapped), arguments.seed)
            index, waits, errors, keyframes = n_mapped, Counter(), [], 0
            for _ in range(n_gaps):
                for _ in range(length):
                    unseen = blurred(sequence.load(index)) if kind == "blurred" else world.black()
                    keyframes += world.show(unseen).is_keyframe
                    index += 1
                found = None
                for k in range(second):
                    T_wc = sequence.T_wc(index)
                    record = world.show(sequence.load(index))
                    index += 1
                    if record.state is TrackingState.OK:
                        found = k if found is None else found
                        errors.append(world.error(record, T_wc))
                waits[found] += 1
            print(
                f"  {kind} for {length} images: frames until found "
                f"{dict(sorted(waits.items(), key=str))}, {keyframes} keyframes of images "
                f"{kind}\n    {summary(errors)}",
                flush=True,
            )


def blurred(images: Images, length: int = 61) -> Images:
    """As by a fast turn while the shutter was open, in both images of a pair."""
    right = None if images.right is None else cv2.blur(images.right, (length, 1))
    return Images(cv2.blur(images.image, (length, 1)), right, images.depth)


# ---- recall --------------------------------------------------------------------------------------
def recall(arguments: argparse.Namespace, sensor: str) -> None:
    """Viewpoints within 0.5 m and 20 degrees of the path, exposure from 0.6 to 1.6."""
    world = mapped(arguments, sensor)
    world.system.localization_mode = True
    rng = np.random.default_rng(arguments.seed)
    found, errors, times = 0, [], []
    for number in range(arguments.count):
        world.lose()
        T_wc = world.sequence.T_wc(int(rng.integers(world.n_frames)))
        T_wc = beside(T_wc, rng, 0.5, 20.0)
        exposure = float(np.exp(rng.uniform(np.log(0.6), np.log(1.6))))
        shown = world.sequence.view(T_wc, 1_000_000 + number, exposure=exposure)
        record = world.show(shown)
        times.append(record.milliseconds["predict"])
        if record.state is TrackingState.OK:
            found += 1
            errors.append(world.error(record, T_wc))
    n_wrong = sum(not e.is_within(WRONG, 180.0) for e in errors)
    print(
        f"  found {found} of {arguments.count} ({found / arguments.count:.1%}), {n_wrong} of them "
        f"more than {WRONG:g} m away; attempt "
        f"{np.median(times):.1f} ms (median), {np.percentile(times, 99):.1f} ms (p99)"
    )
    print(f"  {summary(errors)}", flush=True)


# ---- foreign -------------------------------------------------------------------------------------
def foreign_views(arguments: argparse.Namespace, sensor: str) -> Iterator[tuple[str, Images]]:
    """Images of other worlds, then the photographs (as both images of a pair, or at 2 m)."""
    rng = np.random.default_rng(arguments.seed)
    worlds = list(SyntheticWorld)
    size = sequence_of(arguments, sensor).load(0).image.shape
    for number in range(arguments.count // 20):
        sequence = sequence_of(
            arguments, sensor, world=worlds[number % len(worlds)], seed=1000 + number,
            size=size[::-1],
        )  # fmt: skip
        for index in rng.integers(len(sequence), size=20):
            yield "worlds", sequence.load(int(index))
    shared = shared_folder()
    files = [] if shared is None else sorted((shared / "vocabulary_images").glob("*"))
    for file in files:
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if image is not None:
            image = cv2.resize(image, size[::-1])
            shown = Images(image)
            if sensor == "stereo":
                shown = Images(image, right=np.roll(image, -20, axis=1))
            elif sensor == "rgbd":
                shown = Images(image, depth=np.full(image.shape, 10_000, np.uint16))
            yield "photographs", shown


def foreign(arguments: argparse.Namespace, sensor: str) -> None:
    """With mapping on: a lost frame may also be found by the reference keyframe."""
    world = mapped(arguments, sensor)
    world.lose()
    shown, found, times = Counter(), Counter(), []
    for kind, images in foreign_views(arguments, sensor):
        record = world.show(images)
        shown[kind] += 1
        times.append(record.milliseconds["predict"])
        if record.state is TrackingState.OK:
            found[kind] += 1
            world.lose()
    print(
        f"  shown {dict(shown)}, found {dict(found)}; attempt {np.median(times):.1f} ms (median), "
        f"{np.percentile(times, 99):.1f} ms (p99)",
        flush=True,
    )


# ---- localization mode ---------------------------------------------------------------------------
def localization(arguments: argparse.Namespace, sensor: str) -> None:
    """Walk on past the end of the map and back, and again."""
    world = mapped(arguments, sensor)
    n, beyond = world.n_frames, arguments.beyond
    world.system.localization_mode = True
    before = world.system.map_hash()
    begin = time.perf_counter()
    for turn in range(10):
        states: Counter[str] = Counter()
        errors = []
        out = range(n - 20, n + beyond)
        for index in [*out, *reversed(out)]:
            T_wc = world.sequence.T_wc(index)
            record = world.show(world.sequence.load(index))
            states["odometry" if record.visual_odometry else record.state.name] += 1
            if record.state is TrackingState.OK:
                errors.append(world.error(record, T_wc))
        same = "unchanged" if world.system.map_hash() == before else "CHANGED"
        last = errors[-1]
        print(
            f"  turn {turn + 1}: {dict(states)}, at the turn "
            f"{max(e.translation_m for e in errors) * 100:.1f} cm, "
            f"back {last.translation_m * 100:.2f} cm {last.rotation_deg:.2f} deg, "
            f"map {same}, {resident_mb():.1f} MB (peak {peak_mb():.1f})",
            flush=True,
        )
    print(f"  {time.perf_counter() - begin:.1f} s")


# ---- speed ---------------------------------------------------------------------------------------
def times_of(name: str, function: Callable[[], object], repeat: int, limit: float) -> None:
    report(name, [milliseconds_of(function) for _ in range(repeat)], limit)


def report(name: str, milliseconds: list[float], limit: float) -> None:
    median = float(np.median(milliseconds))
    print(
        f"{name}: {median:.2f} ms (median), {np.percentile(milliseconds, 99):.2f} ms (p99), "
        f"{min(milliseconds):.2f} ms (least); limit {limit:g} ms "
        f"{in_words(median < limit)}",
        flush=True,
    )


def speed(arguments: argparse.Namespace, sensor: str) -> None:
    """Always for a single camera: other sensors need less work."""
    if sensor != "mono":
        return
    sequence = sequence_of(arguments, sensor)
    system = System(sequence.settings, sensor, deterministic=True)
    tries, sizes = [], []
    for start in (0, 60, 250, 400):  # ways to walls that give many attempts
        for index in range(start, start + 25):
            record = system.track_monocular(
                sequence.load(index).image, len(tries) + index + 1e3 * start, details=True
            )
            if record.state is TrackingState.NOT_INITIALIZED and record.reason in ATTEMPTED:
                tries.append(record.milliseconds["keyframe"])
                sizes.append(len(record.features.keypoints))
        system.reset()
    report(f"initialisation attempt, {np.median(sizes):.0f} keypoints", tries, 15)
    _relocalization_speed(arguments, sensor)
    _query_speed(sequence)


def _relocalization_speed(arguments: argparse.Namespace, sensor: str) -> None:
    """Twelve candidates around the place, none of which is ever good enough: the worst case."""
    world = mapped(argparse.Namespace(**{**vars(arguments), "frames": 260}), sensor)
    pipeline, n_candidates = world.system.pipeline, 12
    image, T_wc = world.sequence.load(150).image, world.sequence.T_wc(150)
    frame = pipeline.front_end.monocular(image, 9999, 0.0, StageTimer())
    core.describe(frame, world.system.vocabulary)
    slam_map, index = pipeline.back_end.map, pipeline.back_end.keyframe_index
    ids = core.snapshot_keyframes(slam_map).ids
    distances = np.linalg.norm(world.true_T_wk[:, :3, 3] - T_wc[:3, 3], axis=1)
    first = min(max(int(distances.argmin()) - n_candidates // 2, 0), len(ids) - n_candidates)
    ids = ids[first : first + n_candidates]
    chosen = [SimpleNamespace(keyframe=int(i), group_score=1.0) for i in ids]
    query = core.find_relocalization_candidates
    limits = {"never good enough": 10**6, "as it is": 50}
    try:
        core.find_relocalization_candidates = lambda *_: chosen
        for name, enough in limits.items():
            config = RelocalizationConfig(enough=enough, word_candidates=n_candidates)
            relocalizer = Relocalizer(slam_map, index, 0, fix_scale=False, config=config)
            keyframes, _ = relocalizer._places.of(frame, LostSearch())
            candidates = relocalizer._fitting.matched(core.TrackedFrame(frame), keyframes)
            times_of(
                f"relocalization, {n_candidates} keyframes, {len(candidates)} of them with enough "
                f"matches, {name}",
                lambda r=relocalizer: r.relocalize(  # type: ignore[misc]
                    core.TrackedFrame(frame), LostSearch()
                ),
                30,
                30,
            )
    finally:
        core.find_relocalization_candidates = query


def _query_speed(sequence: SyntheticSequence) -> None:
    """Every third of 750 images, twenty times over, makes an index of 5000 keyframes."""
    slam_map, index, vocabulary = core.Map(), core.KeyFrameIndex(), load_vocabulary()
    front_end, recent = FrontEnd(sequence.settings, Sensor.MONOCULAR), core.RecentPoints()
    frames = []
    for number in range(0, 750, 3):
        frame = front_end.monocular(sequence.load(number).image, number, number, StageTimer())
        core.describe(frame, vocabulary)
        frames.append(frame)
    for _ in range(5000 // len(frames)):
        for frame in frames:
            tracked = core.TrackedFrame(frame)
            tracked.T_cw = core.Pose()
            keyframe = core.insert_keyframe(slam_map, tracked, create_points=False)
            core.process_new_keyframe(slam_map, keyframe, recent)
            core.index_keyframe(index, slam_map, keyframe)
    asked = iter(frames)
    times_of(
        f"candidates among {len(index)} keyframes ({len(frames)} views)",
        lambda: core.find_relocalization_candidates(index, slam_map, next(asked)),
        len(frames),
        5,
    )


def _size(text: str) -> tuple[int, int]:
    width, height = map(int, text.split("x"))
    return width, height


def main() -> None:
    parts = {f.__name__: f for f in (kidnap, gaps, recall, foreign, localization, speed)}
    parser = new_parser(__doc__)
    parser.add_argument("part", choices=parts, help="see above")
    add_sensors(parser)
    worlds = [str(world) for world in SyntheticWorld]
    parser.add_argument("--world", choices=worlds, default="corridor", help="[corridor]")
    parser.add_argument("--size", type=_size, metavar="WxH", help="of the images [the world's]")
    parser.add_argument(
        "--frames", type=int, help="mapped frames [all, gaps: 120, localization: 200]"
    )
    parser.add_argument("--count", type=int, help="tries, or foreign images")
    add_counts(
        parser, beyond=(60, "frames past the end of the map"), seed=(0, "of all random draws")
    )
    arguments = parser.parse_args()
    counts = {"kidnap": 20, "gaps": 4, "recall": 300, "foreign": 1000}
    arguments.count = arguments.count or counts.get(arguments.part, 0)
    if arguments.part == "localization":
        arguments.frames = arguments.frames or 200
    for sensor in arguments.sensors:
        parts[arguments.part](arguments, sensor)


if __name__ == "__main__":
    main()
