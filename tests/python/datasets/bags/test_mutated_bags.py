# SPDX-License-Identifier: BSD-3-Clause
"""Bags with some wrong bytes: read, or refused in words that name the file."""

from __future__ import annotations

import random
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.datasets import BagSequence
from orbslam2py.datasets.bags import libraries
from support import bags

#: So many files of each kind, with wrong bytes at places that do not change from day to day.
TRIALS = 150
#: The head and the declarations, where a wrong byte does most, lie within so many bytes.
HEAD = 6000


def zstd() -> Any:
    return libraries.require(libraries._ZSTD)


def small_bag(folder: Path, kind: str) -> Path:
    """A few images with a calibration and poses."""
    generator = np.random.default_rng(3)
    messages: list[bags.Made] = []
    for i in range(5):
        stamp = bags.START + i * bags.STEP
        pixels = generator.integers(0, 256, (24, 32)).astype(np.uint8)
        messages.append(bags.camera_info("/cam/camera_info", stamp))
        messages.append(bags.raw_image("/cam/image_raw", stamp, pixels, "mono8"))
        messages.append(bags.text("/said", stamp, "something"))
    file = bags.file_of(bags.write(folder / "whole", kind, messages))
    return Path(shutil.copy(file, folder / f"drive{file.suffix}"))


def mutated(content: bytes, chance: random.Random) -> bytes:
    spoilt = bytearray(content)
    for _ in range(chance.choice((1, 3, 20))):
        reach = len(spoilt) if chance.random() < 0.5 else min(len(spoilt), HEAD)
        spoilt[chance.randrange(reach)] = chance.randrange(256)
    return bytes(spoilt[: chance.randrange(len(spoilt))] if chance.random() < 0.2 else spoilt)


def read_all(path: Path) -> None:
    sequence = BagSequence(path)
    for index in range(len(sequence)):
        try:
            sequence.load(index)
        except orb.OrbSlamError as error:
            assert str(path) in str(error)
    sequence.ground_truth()


@pytest.mark.watchdog(120)
@pytest.mark.parametrize("kind", bags.KINDS)
def test_wrong_bytes_are_read_over_or_refused(tmp_path: Path, kind: str) -> None:
    path = small_bag(tmp_path, kind)
    content, chance = path.read_bytes(), random.Random(1)
    refused = 0
    for _ in range(TRIALS):
        path.write_bytes(mutated(content, chance))
        try:
            read_all(path)
        except orb.OrbSlamError as error:
            refused += 1
            assert "drive" in str(error)
    assert 0 < refused < TRIALS


def changed(folder: Path, statement: str) -> Path:
    path = small_bag(folder, "rosbag2")
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA writable_schema = ON")
        database.execute("UPDATE sqlite_master SET sql = replace(sql, 'NOT NULL', '')")
    with sqlite3.connect(path) as database:
        database.execute(statement)
    return path


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE topics SET name = NULL",
        "UPDATE topics SET type = NULL",
        "UPDATE topics SET serialization_format = NULL",
        "UPDATE topics SET name = 7",
        "UPDATE topics SET name = CAST(x'fd' AS TEXT)",
        "UPDATE topics SET type = x'00ff'",
        "UPDATE messages SET timestamp = NULL",
        "UPDATE messages SET timestamp = 'yesterday'",
        "UPDATE messages SET topic_id = NULL",
        "UPDATE messages SET data = NULL",
        "UPDATE messages SET data = 'text'",
        "DELETE FROM messages WHERE id > 1",
    ],
)
def test_tables_that_hold_other_things(tmp_path: Path, statement: str) -> None:
    path = changed(tmp_path, statement)
    try:
        read_all(path)
    except orb.OrbSlamError as error:
        assert "drive.db3" in str(error)
        assert len(str(error)) < 400


def test_a_connection_without_its_number(tmp_path: Path) -> None:
    path = small_bag(tmp_path, "rosbag1")
    path.write_bytes(path.read_bytes().replace(b"conn=", b"comm="))
    with pytest.raises(orb.DatasetError, match=r"drive\.bag .*copy it again"):
        BagSequence(path)


def test_a_declaration_that_ends_too_early(tmp_path: Path) -> None:
    """The text of a channel is longer than the record that holds it."""
    path = small_bag(tmp_path, "mcap")
    content = bytearray(path.read_bytes())
    at = content.index(b"/cam/camera_info")
    content[at - 4 : at] = (2**30).to_bytes(4, "little")
    path.write_bytes(bytes(content))
    try:
        read_all(path)
    except orb.OrbSlamError as error:
        assert "drive.mcap" in str(error)


@pytest.mark.parametrize("damaged", [0, 8, 1000, -2], ids=["first", "head", "middle", "end"])
def test_a_compressed_file_with_a_wrong_byte(tmp_path: Path, damaged: int) -> None:
    """What could be unpacked is read, or the file refused."""
    whole = small_bag(tmp_path, "rosbag1").read_bytes()
    content = bytearray(zstd().compress(whole))
    content[damaged] ^= 0x55
    path = tmp_path / "packed.bag.zstd"
    path.write_bytes(content)
    try:
        read_all(path)
    except orb.OrbSlamError as error:
        assert "packed.bag.zstd" in str(error)
