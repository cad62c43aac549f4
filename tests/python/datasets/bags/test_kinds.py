# SPDX-License-Identifier: BSD-3-Clause
"""Bags of every kind give the same frames, at any index, whatever lies around them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import orbslam2py as orb
from orbslam2py.datasets import BagSequence, open_input, open_sequence
from orbslam2py.settings import Sensor
from support import bags

N = 6


def grey(number: int, size: tuple[int, int] = (32, 24)) -> npt.NDArray[np.uint8]:
    width, height = size
    ramp = np.arange(width * height).reshape(height, width)
    return ((ramp * 3 + 17 * number) % 251).astype(np.uint8)


def stereo_messages() -> list[bags.Made]:
    found = []
    for i in range(N):
        stamp = bags.START + i * bags.STEP
        found += [
            bags.camera_info("/cam/left/camera_info", stamp),
            bags.camera_info("/cam/right/camera_info", stamp, bf=2.0),
            bags.raw_image("/cam/left/image_rect", stamp, grey(i), "mono8"),
            bags.raw_image("/cam/right/image_rect", stamp, grey(100 + i), "mono8"),
            bags.text("/talk", stamp, "x" * 1000),
        ]
    return found


@pytest.fixture(params=bags.KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_stereo(tmp_path: Path, kind: str) -> None:
    path = bags.write(tmp_path / "drive", kind, stereo_messages())
    sequence = open_sequence(path)
    assert isinstance(sequence, BagSequence)
    assert (sequence.sensor, sequence.layout, sequence.name) == (Sensor.STEREO, kind, "drive")
    assert [sequence.timestamp_text(i) for i in (0, 1)] == [
        "1700000000.123456789",
        "1700000000.173456789",
    ]
    assert sequence.timestamps[1] == float("1700000000.173456789")
    for i in (3, 0, 5, 3):  # in any order
        images = sequence.load(i)
        assert np.array_equal(images.image, grey(i))
        assert images.right is not None
        assert np.array_equal(images.right, grey(100 + i))
    camera = sequence.settings.camera
    assert (camera.fx, camera.cx, camera.bf, camera.fps) == (20, 15.5, 2.0, 20.0)
    assert sequence.settings.rectification is None
    with pytest.raises(IndexError):
        sequence.load(N)


def test_file_and_folder(tmp_path: Path, kind: str) -> None:
    path = bags.write(tmp_path / "rec" / "drive", kind, stereo_messages())
    folder = path.parent if kind == "rosbag1" else path
    for given in (folder, bags.file_of(path)):
        opened = open_input(given, "mono")
        assert isinstance(opened, BagSequence)
        assert opened.topics.left.topic.name == "/cam/left/image_rect"
        assert np.array_equal(opened.load(2).image, grey(2))


def test_loop_over_frames(tmp_path: Path, kind: str) -> None:
    sequence = orb.open_sequence(bags.write(tmp_path / "drive", kind, stereo_messages()), "stereo")
    seen = [(frame.index, frame.text) for frame in sequence]
    assert [index for index, _ in seen] == list(range(N))
    assert seen[-1][1] == "1700000000.373456789"


def test_order_of_recording_does_not_matter(tmp_path: Path, kind: str) -> None:
    messages = stereo_messages()
    shuffled = [messages[k] for k in np.random.default_rng(1).permutation(len(messages))]
    in_order = open_sequence(bags.write(tmp_path / "a", kind, messages))
    sequence = open_sequence(bags.write(tmp_path / "b", kind, shuffled))
    assert np.array_equal(sequence.timestamps, in_order.timestamps)
    for i in range(N):
        assert np.array_equal(sequence.load(i).image, in_order.load(i).image)


def test_many_chunks(tmp_path: Path, kind: str) -> None:
    """More than fits into one chunk of a file, or one page of a database."""
    size = (640, 480)
    messages = [
        bags.raw_image("/image", bags.START + i * bags.STEP, grey(i, size), "mono8")
        for i in range(8)
    ]
    sequence = open_sequence(bags.write(tmp_path / "big", kind, messages), settings="tum1")
    assert len(sequence) == 8
    for i in (7, 1, 4):
        assert np.array_equal(sequence.load(i).image, grey(i, size))


def test_options_that_do_not_go_with_it(tmp_path: Path, kind: str) -> None:
    path = bags.write(tmp_path / "drive", kind, stereo_messages())
    with pytest.raises(orb.DatasetError, match=f"--fps is for a folder.*is {kind}"):
        open_input(path, fps=10)
    with pytest.raises(orb.DatasetError, match="rgbd images; it can be used as: stereo, mono"):
        open_input(path, "rgbd")
    with pytest.raises(orb.DatasetError, match="--topics is for a bag"):
        (tmp_path / "none").mkdir()
        open_input(tmp_path / "none", topics="left=/a")


def test_parts_of_one_recording(tmp_path: Path) -> None:
    messages = stereo_messages()
    for part in (0, 1, 2):
        bags.write(
            tmp_path / "all" / f"run_{part}", "rosbag1", messages[part * 10 : part * 10 + 10]
        )
    sequence = open_sequence(tmp_path / "all")
    assert len(sequence) == N
    assert np.array_equal(sequence.load(5).image, grey(5))
    bags.write(tmp_path / "all" / "other", "rosbag1", messages)
    with pytest.raises(orb.DatasetError, match="holds 4 bags that are no parts of one recording"):
        open_sequence(tmp_path / "all")
