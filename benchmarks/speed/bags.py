# SPDX-License-Identifier: BSD-3-Clause
"""Bags against files: how fast the same images are opened and read.

``python -m benchmarks.speed.bags --help``. The goal: a bag is read at 0.8 times the speed of the
same images as files, or faster. Bags hold raw images, files are PNG; and JPEG in both.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import orbslam2py as orb
from orbslam2py.datasets import Sequence
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

GOAL = 0.8
_KIND = "sensor_msgs/msg/CompressedImage"


def read_all(open_it: Callable[[], Sequence]) -> tuple[float, float]:
    """Seconds to open, and to read all frames in order."""
    begin = time.perf_counter()
    sequence = open_it()
    _ = sequence.settings
    opened = time.perf_counter()
    for i in range(len(sequence)):
        sequence.load(i)
    return opened - begin, time.perf_counter() - opened


def write_jpegs(world: SyntheticSequence, folder: Path) -> tuple[Path, Path]:
    """The left images as JPEG files, and as CompressedImage in an MCAP file."""
    (folder / "jpeg").mkdir()
    store = get_typestore(Stores.ROS2_HUMBLE)
    header, stamp, image = (
        store.types[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", _KIND)
    )
    with Writer(folder / "jpegs", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        channel = writer.add_connection("/camera/image_raw/compressed", _KIND, typestore=store)
        for i, nanoseconds in enumerate(world.nanoseconds.tolist()):
            content = cv2.imencode(".jpg", world.load(i).image)[1]
            (folder / "jpeg" / f"{i:06d}.jpg").write_bytes(content.tobytes())
            time_stamp = stamp(nanoseconds // 10**9, nanoseconds % 10**9)
            message = image(header(time_stamp, "camera"), "jpeg", content.reshape(-1))
            writer.write(channel, nanoseconds, store.serialize_cdr(message, _KIND))
    return folder / "jpeg", folder / "jpegs"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    options = SyntheticOptions(
        world="corridor", sensor="stereo", frames=arguments.frames, size=(width, height)
    )
    world = SyntheticSequence(options, threads=2)
    world.load = cache(world.load)  # type: ignore[method-assign]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = world.write(folder / "kitti", "kitti")
        cases: dict[str, tuple[Callable[[], Sequence], Callable[[], Sequence]]] = {}
        for kind in ("rosbag1", "rosbag2", "mcap"):
            bag = world.write(folder / kind, kind)
            cases[f"{kind}, raw, against PNG"] = (
                lambda bag=bag: orb.open_sequence(bag, "stereo"),
                lambda: orb.open_sequence(files, "stereo"),
            )
        images, bag = write_jpegs(world, folder)
        cases["mcap, JPEG, against JPEG"] = (
            lambda: orb.open_sequence(bag, "mono", settings="tum1"),
            lambda: orb.datasets.open_input(images, "mono", settings="tum1"),
        )
        print(f"{arguments.frames} frames of {arguments.size}, medians of {arguments.rounds}")
        print("| bag | open [ms] | frame [ms] | files: open [ms] | frame [ms] | speed |")
        print("|---|---|---|---|---|---|")
        for what, (bag_of, files_of) in cases.items():
            pairs = [(read_all(bag_of), read_all(files_of)) for _ in range(arguments.rounds)]
            ours, theirs = (np.median([pair[k] for pair in pairs], axis=0) for k in (0, 1))
            n = arguments.frames / 1e3
            speed = theirs.sum() / ours.sum()
            reached = "" if speed >= GOAL else f" (goal {GOAL})"
            print(
                f"| {what} | {ours[0] * 1e3:.1f} | {ours[1] / n:.2f} | {theirs[0] * 1e3:.1f} "
                f"| {theirs[1] / n:.2f} | {speed:.2f}{reached} |"
            )


if __name__ == "__main__":
    main()
