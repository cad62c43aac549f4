# SPDX-License-Identifier: BSD-3-Clause
"""Bags that are cut off, not ended, incomplete or something else."""

from __future__ import annotations

import contextlib
import re
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import orbslam2py as orb
from orbslam2py.datasets import BagSequence
from support import bags
from support.data import shared_folder

N = 60


def made(n: int = N) -> list[bags.Made]:
    random = np.random.default_rng(3)
    images = random.integers(0, 256, (n, 120, 160)).astype(np.uint8)
    found: list[bags.Made] = []
    for i, image in enumerate(images):
        stamp = bags.START + i * bags.STEP
        found.append(bags.camera_info("/cam/camera_info", stamp, size=(160, 120)))
        found.append(bags.raw_image("/cam/image_raw", stamp, image, "mono8"))
    return found


@pytest.fixture(params=bags.KINDS)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The file of a bag alone; more than one chunk of the usual size."""
    path = bags.write(tmp_path / "whole", request.param, made())
    return Path(shutil.copy(bags.file_of(path), tmp_path / f"drive{bags.file_of(path).suffix}"))


def test_cut_off_anywhere(bag: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Whatever is left is read, or the file is refused; never anything else."""
    content = bag.read_bytes()
    whole = [BagSequence(bag).load(i).image for i in range(N)]
    read = []
    for size in np.linspace(0, len(content) - 1, 41).astype(int).tolist():
        bag.write_bytes(content[:size])
        caplog.clear()
        try:
            sequence = BagSequence(bag)
        except orb.DatasetError as error:
            assert str(bag) in str(error)
            continue
        read.append(len(sequence))
        for i in (0, len(sequence) - 1):
            with contextlib.suppress(orb.ImageError):  # a page of a database may be lost
                assert np.array_equal(sequence.load(i).image, whole[i])
        if len(sequence) < N:
            assert re.search("cut off|no index|damaged", caplog.text), size
    assert len(read) >= 20
    assert read == sorted(read)
    assert read[-1] >= N - 2


def test_other_bytes_in_between(bag: Path) -> None:
    """A damaged part is an error of the package, or an image that cannot be read."""
    content = bytearray(bag.read_bytes())
    random = np.random.default_rng(8)
    for _ in range(60):
        spoilt = content.copy()
        at = int(random.integers(0, len(content) - 64))
        spoilt[at : at + 64] = random.integers(0, 256, 64).astype(np.uint8).tobytes()
        bag.write_bytes(spoilt)
        with contextlib.suppress(orb.DatasetError, orb.ImageError):
            sequence = BagSequence(bag)
            for i in (0, len(sequence) // 2, len(sequence) - 1):
                with contextlib.suppress(orb.ImageError):
                    sequence.load(i)


def test_text_in_the_place_of_a_bag(bag: Path) -> None:
    bag.write_text("no bag\n" * 100)
    with pytest.raises(orb.DatasetError, match=r"drive.*(no bag|no SQLite|no MCAP)"):
        BagSequence(bag)
    bag.write_bytes(b"")
    with pytest.raises(orb.DatasetError, match="drive"):
        BagSequence(bag)


def test_a_recording_that_was_not_ended(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """ROS 1 leaves a file .active, whose header has no place of an index, and no index."""
    path = bags.write(tmp_path / "b", "rosbag1", made())
    content = path.read_bytes()
    field = content.index(b"index_pos=")
    position = int.from_bytes(content[field + 10 : field + 18], "little")
    active = tmp_path / "b.bag.active"
    active.write_bytes(content[: field + 10] + b"\0" * 8 + content[field + 18 : position])
    sequence = BagSequence(active)
    assert len(sequence) == N
    assert "b.bag.active has no index, so its recording was not ended in order" in caplog.text


def test_mcap_without_its_summary(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = bags.file_of(bags.write(tmp_path / "b", "mcap", made()))
    content = path.read_bytes()
    alone = tmp_path / "alone.mcap"
    alone.write_bytes(content[:-400])
    assert len(BagSequence(alone)) == N
    assert "alone.mcap is cut off: its end is missing" in caplog.text


def test_older_version(tmp_path: Path) -> None:
    path = tmp_path / "old.bag"
    path.write_bytes(b"#ROSBAG V1.2\n" + b"\0" * 100)
    with pytest.raises(orb.DatasetError, match=r"version V1.2 of the format.*rosbag migrate"):
        BagSequence(path)


def test_a_database_of_something_else(tmp_path: Path) -> None:

    path = tmp_path / "other.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE things (id INTEGER)")
    with pytest.raises(orb.DatasetError, match="no bag of ROS 2: it has no tables"):
        BagSequence(path)


@pytest.mark.parametrize("kind", ["rosbag2", "mcap"])
def test_metadata(tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture) -> None:
    path = bags.write(tmp_path / "b", kind, made(4))
    metadata = path / "metadata.yaml"
    text = metadata.read_text()
    metadata.unlink()
    assert len(BagSequence(path)) == 4
    assert "has no metadata.yaml; all bags in the folder are taken" in caplog.text
    metadata.write_text("- nothing\n: of\tthis")
    assert len(BagSequence(path)) == 4
    assert "metadata.yaml is damaged" in caplog.text
    document = yaml.safe_load(text)
    document["rosbag2_bagfile_information"]["relative_file_paths"].append("missing_1.mcap")
    metadata.write_text(yaml.safe_dump(document))
    caplog.clear()
    assert len(BagSequence(path)) == 4
    assert "is not complete: missing_1" in caplog.text
    bags.file_of(path).unlink()
    with pytest.raises(orb.DatasetError, match=r"none of the 2 files that .*metadata.yaml lists"):
        BagSequence(path)


def test_compressed_by_rosbag2(tmp_path: Path) -> None:
    """By message, and by file."""

    plain = BagSequence(bags.write(tmp_path / "plain", "mcap", made(5)))
    store = get_typestore(Stores.ROS2_HUMBLE)
    for mode in (CompressionMode.MESSAGE, CompressionMode.FILE):
        for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
            path = tmp_path / f"{mode.name}-{plugin.name}"
            writer = Writer(path, version=8, storage_plugin=plugin)
            writer.set_compression(mode, CompressionFormat.ZSTD)
            with writer:
                channel = writer.add_connection("/cam/image_raw", bags.IMAGE, typestore=store)
                for one in made(5)[1::2]:
                    message = bags.message_of(store, one, ros1=False)
                    writer.write(channel, one.stamp, store.serialize_cdr(message, bags.IMAGE))
            sequence = BagSequence(path, settings="tum1")
            assert len(sequence) == 5
            for i in (4, 0):
                assert np.array_equal(sequence.load(i).image, plain.load(i).image)


def test_compressed_chunks(tmp_path: Path) -> None:

    plain = BagSequence(bags.write(tmp_path / "plain", "rosbag1", made()))
    store = get_typestore(Stores.ROS1_NOETIC)
    for form in (Writer1.CompressionFormat.BZ2, Writer1.CompressionFormat.LZ4):
        writer = Writer1(tmp_path / f"{form.name}.bag")
        writer.set_compression(form)
        with writer:
            channel = writer.add_connection("/cam/image_raw", bags.IMAGE, typestore=store)
            for one in made()[1::2]:
                message = bags.message_of(store, one, ros1=True)
                writer.write(channel, one.stamp, store.serialize_ros1(message, bags.IMAGE))
        sequence = BagSequence(tmp_path / f"{form.name}.bag", settings="tum1")
        assert len(sequence) == N
        for i in (N - 1, 0, 30):
            assert np.array_equal(sequence.load(i).image, plain.load(i).image)


SHARED = {
    "one_compressed_image.bag": 1,
    "size_changes.bag": "3 sizes (2 of 225 x 225, 1 of 224 x 224, 1 of 220 x 220)",
    "no_metadata.db3": "no CameraInfo for /image;",
    "amber_soccer_goal": "no CameraInfo for /camera/image_raw;",
    "amber_soccer_goal/soccer_goal_12.mcap": "no CameraInfo for /camera/image_raw;",
    "types_mcap": "images that cannot be read; the first of /test/sensor_msgs/compressed_image",
    "types_mcap/test_bag_mcap.mcap": "images that cannot be read",
    "types_sqlite3": "images that cannot be read",
    "types_sqlite3/test_bag_sqlite3.db3": "images that cannot be read",
    "odd/ecto_t01_caminfo_only.bag": "holds calibrations (CameraInfo), but no images",
    "odd/cruise_no-messages.bag": "holds no messages",
    "odd/cruise_unsorted-chunks.bag": "holds no images: it has /foo (std_msgs/msg/String, 3 ",
    "odd/cruise_example-bz2_noimages.bag": "/rosout (rosgraph_msgs/msg/Log, 10 messages)",
    "odd/webviz_empty-msgdef.bag": "/led_array_status (led_array_msgs/msg/Status, 14 messages)",
    "odd/rosbag2_empty_bag_0.db3": "holds no messages",
    "odd/rosbag2_wrong_rmw_0.db3": "/array_topic (test_msgs/msg/Arrays, 4 messages)",
}
#: Frames of those that are read when settings are given.
READ = {"no_metadata.db3": 1, "amber_soccer_goal": 2, "amber_soccer_goal/soccer_goal_12.mcap": 2}


def shared_bags() -> Path:
    folder = shared_folder() / "bags"
    if not folder.is_dir():
        pytest.skip(f"{folder} is missing; ORBSLAM2PY_SHARED names the folder of the extra data")
    return folder


@pytest.mark.shared
def test_every_shared_bag_is_known() -> None:
    folder = shared_bags()
    files = {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.suffix in (".bag", ".db3", ".mcap")
    }
    assert files <= set(SHARED)


@pytest.mark.shared
@pytest.mark.parametrize("name", SHARED)
def test_shared_bags(name: str) -> None:
    """Read, or refused with what is in it and what is missing."""
    path, expected = shared_bags() / name, SHARED[name]
    if isinstance(expected, int):
        sequence = BagSequence(path)
        assert len(sequence) == expected
        height, width = sequence.load(0).image.shape[:2]
        assert (width, height) == (sequence.settings.camera.width, sequence.settings.camera.height)
        return
    with pytest.raises(orb.DatasetError) as told:
        _ = BagSequence(path).settings
    assert expected in str(told.value)
    assert str(path) in str(told.value)
    if name in READ:
        sequence = BagSequence(path, settings="tum1")
        assert len(sequence) == READ[name]
        assert sequence.load(len(sequence) - 1).image.shape == (480, 640, 3)
