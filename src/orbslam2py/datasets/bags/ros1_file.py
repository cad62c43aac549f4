# SPDX-License-Identifier: BSD-3-Clause
"""Bags of ROS 1, version 2.0: records in sequence, messages in chunks.

The format is described at https://wiki.ros.org/Bags/Format/2.0. The index at the end is not needed:
an index of its messages follows each chunk. If it is missing, the chunk itself is searched. So an
incomplete recording is read up to its end.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from orbslam2py.datasets.bags.open_file import OpenFile
from orbslam2py.datasets.bags.parts import (
    Channel,
    ChunkCache,
    Place,
    count_messages,
    decompress,
    entries_of,
    normal_kind,
    normal_topic,
)
from orbslam2py.errors import DatasetError

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG_HEADER, _INDEX, _CHUNK, _CONNECTION = 2, 3, 4, 5, 7
_U32, _TIME = struct.Struct("<I"), struct.Struct("<II")
_INDEX_ENTRY = struct.Struct("<III")
#: Longest head of a record: those of connections hold the definition of their type.
_LONGEST_HEAD = 1 << 20


@dataclass(frozen=True)
class _Chunk:
    compression: str
    position: int
    size: int


@dataclass(frozen=True)
class _Entry:
    recorded: int
    chunk: int
    offset: int


class Ros1File:
    """A file of ROS 1; see `parts.BagFile`.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    DatasetError
        If it is no such file, or it is encrypted.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.doubts: list[str] = []
        self._file = OpenFile(path)
        if self._file.read(0, len(MAGIC)) != MAGIC:
            start = self._file.read(0, len(MAGIC)).split(b"\n")[0].decode("ascii", "replace")
            version = f"version {start[8:]} of the format" if start[:8] == "#ROSBAG " else "no bag"
            raise DatasetError(
                f"{path} is {version}, not a bag of ROS 1 (2.0); convert it with 'rosbag migrate'"
            )
        self._chunks: list[_Chunk] = []
        self._cache = ChunkCache(self._load_chunk)
        self._channels: dict[int, Channel] = {}
        self._entries: dict[int, list[_Entry]] = {}
        self._walk()

    def counts(self) -> dict[Channel, int]:
        """Return the channels and their numbers of messages."""
        return count_messages(self._channels, self._entries)

    def places(self, channel: Channel) -> list[Place]:
        """Return the positions of the messages of a channel, in the order of recording."""
        entries = entries_of(channel, self._channels, self._entries)
        return sorted(place for entry in entries if (place := self._place(entry)) is not None)

    def read(self, place: Place, most: int | None = None) -> bytes:
        """Read a message, or its first bytes."""
        size = place.size if most is None else min(most, place.size)
        if place.chunk < 0:
            return self._file.read(place.offset, size)
        return self._cache[place.chunk][place.offset : place.offset + size]

    # ---- records ---------------------------------------------------------------------------------
    def _walk(self) -> None:
        position, last_chunk, indexed = len(MAGIC), -1, True
        while position < self._file.size:
            head = self._head(position)
            if head is None:
                break
            fields, data, size = head
            operation = fields.get(b"op", b"\0")[0]
            if operation == _CHUNK:
                if not indexed:
                    self._go_through(last_chunk)
                name = fields.get(b"compression", b"none").decode("ascii", "replace")
                whole = min(size, self._file.size - data)
                self._chunks.append(_Chunk(name, data, whole))
                last_chunk, indexed = len(self._chunks) - 1, False
            if data + size > self._file.size:
                missing = data + size - self._file.size
                self.doubts.append(f"is cut off: {missing} bytes of its last part are missing")
                break
            if operation == _BAG_HEADER:
                self._check_header(fields)
            elif operation == _CONNECTION:
                self._connect(fields, self._file.read(data, size))
            elif operation == _INDEX and last_chunk >= 0:
                indexed = True
                self._note_index(fields, self._file.read(data, size), last_chunk)
            position = data + size
        if not indexed:
            self._go_through(last_chunk)
        if set(self._entries) - set(self._channels):
            for number in range(len(self._chunks)):  # connections stand in the chunks as well
                self._go_through(number, connections_only=True)

    def _head(self, position: int) -> tuple[dict[bytes, bytes], int, int] | None:
        """Return fields, data position and size of the record at a position; None at the end."""
        lead = self._file.read(position, 4)
        length = _U32.unpack(lead)[0] if len(lead) == 4 else 0
        content = self._file.read(position + 4, length + 4) if length <= _LONGEST_HEAD else b""
        fields = _fields(content[:length])
        if len(content) != length + 4 or b"op" not in fields:
            rest = self._file.size - position
            self.doubts.append(f"is damaged or cut off {rest} bytes before its end")
            return None
        return fields, position + 4 + length + 4, _U32.unpack_from(content, length)[0]

    def _check_header(self, fields: dict[bytes, bytes]) -> None:
        if fields.get(b"encryptor"):
            raise DatasetError(
                f"{self.path} is encrypted ({fields[b'encryptor'].decode('ascii', 'replace')}); "
                "decrypt it with 'rosbag decrypt'"
            )
        if fields.get(b"index_pos", b"\0" * 8) == b"\0" * 8:
            self.doubts.append("has no index, so its recording was not ended in order")

    def _connect(self, fields: dict[bytes, bytes], data: bytes) -> None:
        inner = _fields(data)
        topic = inner.get(b"topic") or fields.get(b"topic", b"")
        self._channels[_U32.unpack(fields[b"conn"])[0]] = Channel(
            normal_topic(topic.decode("utf-8", "replace")),
            normal_kind(inner.get(b"type", b"").decode("utf-8", "replace")),
            "ros1",
        )

    def _note_index(self, fields: dict[bytes, bytes], data: bytes, chunk: int) -> None:
        entries = self._entries.setdefault(_U32.unpack(fields[b"conn"])[0], [])
        whole = len(data) - len(data) % _INDEX_ENTRY.size
        for seconds, nanoseconds, offset in _INDEX_ENTRY.iter_unpack(data[:whole]):
            entries.append(_Entry(seconds * 10**9 + nanoseconds, chunk, offset))

    def _go_through(self, chunk: int, *, connections_only: bool = False) -> None:
        """Read the index entries from the chunk itself."""
        try:
            content = self._cache[chunk]
        except DatasetError as error:
            self.doubts.append(f"cannot be read to its end: {error}")
            return
        for offset, fields, begin, size in _records(content):
            operation = fields[b"op"][0]
            if operation == _CONNECTION:
                self._connect(fields, content[begin : begin + size])
            elif operation == _MESSAGE and not connections_only:
                seconds, nanoseconds = _TIME.unpack(fields[b"time"])
                entry = _Entry(seconds * 10**9 + nanoseconds, chunk, offset)
                self._entries.setdefault(_U32.unpack(fields[b"conn"])[0], []).append(entry)

    def _place(self, entry: _Entry) -> Place | None:
        """Find the message after the header of its record; None if it is incomplete."""
        chunk = self._chunks[entry.chunk]
        is_open = chunk.compression == "none"
        base = chunk.position if is_open else 0
        for _ in range(64):  # connections may stand before the message they announce
            if is_open:
                lead = self._file.read(base + entry.offset, 512)
            else:
                lead = self._cache[entry.chunk][entry.offset : entry.offset + 512]
            if len(lead) < 8:
                return None
            length = _U32.unpack_from(lead)[0]
            fields = _fields(lead[4 : 4 + length])
            if len(lead) < 8 + length or b"op" not in fields:
                return None
            size = _U32.unpack_from(lead, 4 + length)[0]
            begin = entry.offset + 8 + length
            if fields[b"op"][0] == _MESSAGE:
                end = base + begin + size
                cut = end > (
                    chunk.position + chunk.size if is_open else len(self._cache[entry.chunk])
                )
                number = -1 if is_open else entry.chunk
                return None if cut else Place(entry.recorded, number, base + begin, size)
            entry = _Entry(entry.recorded, entry.chunk, begin + size)
        return None

    def _load_chunk(self, number: int) -> bytes:
        chunk = self._chunks[number]
        return decompress(self._file.read(chunk.position, chunk.size), chunk.compression)


def _fields(content: bytes) -> dict[bytes, bytes]:
    """Split the header of a record into ``name=value``; other parts are ignored."""
    fields, position = {}, 0
    while position + 4 <= len(content):
        size = _U32.unpack_from(content, position)[0]
        name, found, value = content[position + 4 : position + 4 + size].partition(b"=")
        position += 4 + size
        if not found or position > len(content):
            break
        fields[name] = value
    return fields


def _records(content: bytes) -> Iterator[tuple[int, dict[bytes, bytes], int, int]]:
    """Yield the complete records of a chunk: position, fields, and data."""
    position = 0
    while position + 4 <= len(content):
        length = _U32.unpack_from(content, position)[0]
        begin = position + 8 + length
        fields = _fields(content[position + 4 : begin - 4])
        if begin > len(content) or b"op" not in fields:
            return
        size = _U32.unpack_from(content, begin - 4)[0]
        if begin + size > len(content):
            return
        yield position, fields, begin, size
        position = begin + size
