# SPDX-License-Identifier: BSD-3-Clause
"""Bags on the command line that cannot be run: the thing, the remedy, nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support import bags
from support.command_line import CommandLine

GREY = np.full((24, 32), 90, np.uint8)


def image(topic: str, stamp: int = 0, size: int = 24) -> bags.Made:
    return bags.raw_image(topic, bags.START + stamp, GREY[:size], "mono8")


def camera(
    name: str, f: float = 20, encoding: str = "mono8", model: str = "plumb_bob"
) -> list[bags.Made]:
    """Images and calibration of a camera, in coordinates of its own."""
    grey = GREY.astype(np.uint16) if encoding == "16UC1" else GREY
    made = bags.raw_image(f"/{name}/image", bags.START, grey, encoding, frame=name)
    K = np.array([[f, 0, 15.5], [0, f, 11.5], [0, 0, 1]])
    return [made, bags.camera_info(f"/{name}/camera_info", bags.START, K=K, model=model)]


def shift(x: float, y: float) -> bags.Made:
    T = np.eye(4)
    T[:2, 3] = x, y
    return bags.frames("/tf_static", ("cam1", "cam2", T))


INFO = bags.camera_info("/camera_info", bags.START)
PAIR = [*camera("cam1"), *camera("cam2")]
RGBD = [*camera("rgb"), *camera("depth", 30, "16UC1")]
CASES: dict[str, tuple[list[bags.Made], tuple[str, ...], tuple[str, ...]]] = {
    "none": ([bags.text("/talk", bags.START, "hello")], (), ("holds no images", "/talk (std_m")),
    "infos": ([INFO], (), ("holds calibrations (CameraInfo), but no images", "give a bag with")),
    "plain": ([image("/image")], (), ("has no CameraInfo for /image", "give --settings")),
    "sizes": ([image("/i"), image("/i", 1, 20)], (), ("2 sizes (1 of 32 x 24, 1 of 32 x 20)",)),
    "many": ([image("/a"), image("/b")], (), ("cannot decide which", "/a (sensor_msgs/msg/Image")),
    "pairs": ([image("/a"), INFO], ("--sensor", "stereo"), ("has no stereo images", "mono")),
    "named": ([image("/a"), INFO], ("--topics", "left:/a"), ("no ROLE=/TOPIC", "roles are")),
    "foo": ([image("/a"), INFO], ("--topics", "foo=/a"), ("role 'foo' of 'foo=/a' is unknown",)),
    "absent": ([image("/a"), INFO], ("--topics", "image=/b"), ("no messages of /b", "it has /a")),
    "unlike": (
        [image("/a"), image("/b")],
        ("--sensor", "stereo"),
        ("are the left and right images", "--topics left=/a,right=/b"),
    ),
    "nowhere": (PAIR, (), ("do not contain the distance", "/tf_static", "with --settings")),
    "above": ([*PAIR, shift(0.01, 0.2)], (), ("are not side by side", "--sensor mono")),
    "behind": ([*PAIR, shift(-0.1, 0)], (), ("to the left of the other one", "exchange the two")),
    "half": (PAIR[:3], (), ("no CameraInfo for /cam2/image", "--topics right_info=")),
    "fish": (
        [*camera("cam1", model="polynomial"), *camera("cam2"), shift(0.1, 0)],
        (),
        ("the distortion model polynomial is not supported", "--settings"),
    ),
    "depth": (
        RGBD,
        (),
        ("(fx 30 against 20)", "without the transform", "align_depth.enable:=true"),
    ),
    "both": (RGBD, ("--topics", "depth_info=/none"), ("no messages of /none (depth_info)",)),
    "yuv": (
        [*camera("rgb", encoding="nv99"), *camera("depth", 30, "16UC1")],
        (),
        ("its encoding is nv99; known are mono8", "name them with --topics"),
    ),
    "rate": ([image("/image"), INFO], ("--fps", "10"), ("--fps is for a folder of images",)),
}


@pytest.mark.parametrize("kind", ["rosbag1", "mcap"])
@pytest.mark.parametrize("case", CASES)
def test_bags(command: CommandLine, tmp_path: Path, kind: str, case: str) -> None:
    messages, options, expected = CASES[case]
    bag = bags.file_of(bags.write(tmp_path / "bag" / case, kind, messages))
    done = command("run", bag, *options, "--output", "out", "--quiet")
    assert done.code == 2
    assert done.err.startswith("Error: ")
    for message in (bag.name, *expected):
        if message != bag.name or case not in ("named", "foo"):
            assert message in " ".join(done.err.split()) or message in done.err.replace("\n", "")
    for noise in ("Traceback", "Errno", "DatasetError", "KeyError"):
        assert noise not in done.err
    assert not Path("out").exists()


def test_topics_for_something_else(command: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    done = command("run", "images", "--sensor", "mono", "--topics", "image=/a")
    assert done.code == 2
    assert "--topics is for a bag" in done.err


def test_without_rosbags(
    command: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message has the line that installs it."""
    bag = bags.write(tmp_path / "b", "rosbag1", [image("/image"), INFO])
    monkeypatch.setitem(__import__("sys").modules, "rosbags.serde", None)
    done = command("run", bag)
    assert done.code == 2
    assert "pip install 'orbslam2py[bags]'" in done.err


@pytest.mark.parametrize("kind", bags.KINDS)
def test_run_from_the_command_line(command: CommandLine, kind: str) -> None:
    made = command(
        *("synthesize", "lap", "--world", "corridor", "--sensor", "stereo", "--layout", kind),
        *("--frames", "8", "--size", "320x240", "--quiet"),
    )
    assert made.code == 0, made.err
    done = command("run", "lap", "--sensor", "stereo", "--output", "out", "--quiet", "--no-report")
    assert done.code == 0, done.err
    assert "done" not in done.err
    assert Path("out/report.json").is_file()
    evaluated = command("evaluate", "out/trajectory.txt", "lap")
    assert evaluated.code == 0, evaluated.err
    assert "ate" in evaluated.out
