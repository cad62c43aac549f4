# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of all kinds of bags: topics, positions of messages, chunks."""

from __future__ import annotations

import bz2
import contextlib
import struct
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from orbslam2py.datasets.bags.libraries import lz4_decompress, zstd_decompress
from orbslam2py.errors import DatasetError

EntryT = TypeVar("EntryT")

#: Errors for numbers, texts and fields that violate the format.
_DAMAGE = (struct.error, LookupError, ValueError, OverflowError, MemoryError)
#: Chunks that are kept decompressed: the cameras' messages of one moment lie close together.
_KEPT_CHUNKS = 4


@dataclass(frozen=True)
class Channel:
    """Messages of one type and name, as a file declares them.

    Attributes
    ----------
    topic
        Name of the topic, with a ``/`` before it.
    kind
        Type of the messages, as in ROS 2: ``sensor_msgs/msg/Image``.
    encoding
        Serialisation: ``ros1``, ``cdr``, or another one.
    """

    topic: str
    kind: str
    encoding: str


class Place(NamedTuple):
    """Position of a message in its file; only the file's own class uses the numbers."""

    #: When it was recorded, nanoseconds.
    recorded: int
    #: Number of its chunk; -1 if it lies open in the file.
    chunk: int
    #: Where it begins (or its row in a database).
    offset: int
    #: Bytes of it.
    size: int


class BagFile(Protocol):
    """One file of a bag, of any kind.

    Attributes
    ----------
    doubts
        Faults of the file that do not prevent reading: sentences without the file's name.
    """

    doubts: list[str]

    def counts(self) -> dict[Channel, int]:
        """Return the channels and their numbers of messages."""
        ...

    def places(self, channel: Channel) -> list[Place]:
        """Return the positions of the messages of a channel, in the order of recording."""
        ...

    def read(self, place: Place, most: int | None = None) -> bytes:
        """Read a message, or its first bytes."""
        ...


@contextlib.contextmanager
def naming_damage(path: Path) -> Iterator[None]:
    """Turn any error of damaged bytes into an error that names the file.

    Parameters
    ----------
    path
        The file, or the bag.

    Raises
    ------
    DatasetError
        In place of any error of damaged bytes; an error that names the file is not changed.
    """
    try:
        yield
    except DatasetError as error:
        if str(path) in str(error):
            raise
        raise DatasetError(f"{path}: {error}") from error
    except _DAMAGE as error:
        raise DatasetError(
            f"{path} is damaged: a part of it is not what its format says; copy it again"
        ) from error


def normal_kind(kind: str) -> str:
    """Return the name of a type in today's ROS 2, such as ``sensor_msgs/msg/Image``."""
    package, _, rest = kind.partition("/")
    return kind if not rest or "/" in rest else f"{package}/msg/{rest}"


def normal_topic(topic: str) -> str:
    """Return the name of a topic with one ``/`` before each part."""
    return "/" + "/".join(part for part in topic.split("/") if part)


class ChunkCache:
    """The last chunks that were decompressed; may be used by several threads.

    Parameters
    ----------
    load
        Reads and decompresses the chunk with a number.
    """

    def __init__(self, load: Callable[[int], bytes]) -> None:
        self._load = load
        self._kept: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def __getitem__(self, number: int) -> bytes:
        with self._lock:
            if number in self._kept:
                self._kept.move_to_end(number)
                return self._kept[number]
            content = self._load(number)
            self._kept[number] = content
            while len(self._kept) > _KEPT_CHUNKS:
                self._kept.popitem(last=False)
            return content


def decompress(content: bytes, compression: str) -> bytes:
    """Decompress a chunk.

    Raises
    ------
    DatasetError
        If it is damaged, or its compression is unknown; the message does not name the file.
    """
    try:
        if compression in ("", "none"):
            return content
        if compression == "bz2":
            return bz2.decompress(content)
        if compression == "lz4":
            return lz4_decompress(content)
        if compression == "zstd":
            return zstd_decompress(content)
    except (OSError, ValueError, RuntimeError, EOFError) as error:
        raise DatasetError(f"a chunk ({compression}) is damaged: {error}") from error
    raise DatasetError(
        f"its chunks are compressed as '{compression}', which is not known here; convert the bag"
    )


def count_messages(
    channels: Mapping[int, Channel], entries: Mapping[int, Sequence[object]]
) -> dict[Channel, int]:
    """Return each channel's number of messages; a file may declare a channel several times."""
    counts: dict[Channel, int] = {}
    for number, channel in channels.items():
        counts[channel] = counts.get(channel, 0) + len(entries.get(number, ()))
    return counts


def entries_of(
    channel: Channel, channels: Mapping[int, Channel], entries: Mapping[int, Sequence[EntryT]]
) -> list[EntryT]:
    """Return the entries of a channel in a file, under all of its numbers."""
    numbers = [number for number, one in channels.items() if one == channel]
    return [entry for number in numbers for entry in entries.get(number, ())]
