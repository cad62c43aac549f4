# SPDX-License-Identifier: BSD-3-Clause
"""MCAP files: records with their lengths, messages in chunks or between them.

The format is described at https://mcap.dev/spec. The summary at the end is not needed: an index of
the messages follows each chunk. If it is missing, the chunk itself is searched. So an incomplete
recording is read up to its end.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from orbslam2py.datasets.bags.libraries import ZSTD_MAGIC, zstd_decompress
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

MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = 2, 3, 4, 5, 6, 7
_ATTACHMENT = 9
_LEAD, _U16, _U32 = struct.Struct("<BQ"), struct.Struct("<H"), struct.Struct("<I")
_CHUNK_LEAD = struct.Struct("<QQQII")
_MESSAGE_LEAD = struct.Struct("<HIQQ")
_U64 = struct.Struct("<Q")
_INDEX_ENTRY = struct.Struct("<QQ")
#: More than the head of any chunk is long.
_CHUNK_HEAD = 256


@dataclass(frozen=True)
class _Chunk:
    compression: str
    position: int
    size: int


class McapFile:
    """An MCAP file; see `parts.BagFile`.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    DatasetError
        If it is no such file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.doubts: list[str] = []
        self._file = OpenFile(path)
        if self._file.read(0, len(MAGIC)) != MAGIC:
            raise DatasetError(f"{path} is no MCAP file: it does not begin like one; copy it again")
        self._chunks: list[_Chunk] = []
        self._cache = ChunkCache(self._load_chunk)
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, Channel] = {}
        #: Bytes of the attached files by name.
        self.attachments: dict[str, bytes] = {}
        #: By number of the channel: when recorded, chunk, where the record begins.
        self._entries: dict[int, list[tuple[int, int, int]]] = {}
        self._walk()

    def counts(self) -> dict[Channel, int]:
        """Return the channels and their numbers of messages."""
        return count_messages(self._channels, self._entries)

    def places(self, channel: Channel) -> list[Place]:
        """Return the positions of the messages of a channel, in the order of recording."""
        entries = entries_of(channel, self._channels, self._entries)
        return sorted(place for entry in entries if (place := self._place(*entry)) is not None)

    def read(self, place: Place, most: int | None = None) -> bytes:
        """Read a message, or its first bytes."""
        whole = self._part(place.chunk, place.offset, min(place.size, most or place.size))
        if not whole.startswith(ZSTD_MAGIC):
            return whole
        try:  # rosbag2 compresses single messages
            return zstd_decompress(self._part(place.chunk, place.offset, place.size), most)
        except OSError as error:
            raise DatasetError(f"a message of {self.path} cannot be read: {error}") from error

    # ---- records ---------------------------------------------------------------------------------
    def _walk(self) -> None:
        position, indexed, ended = len(MAGIC), True, False
        while position + _LEAD.size <= self._file.size:
            operation, size = _LEAD.unpack(self._file.read(position, _LEAD.size))
            begin = position + _LEAD.size
            if operation == _CHUNK:
                if not indexed:
                    self._go_through(len(self._chunks) - 1)
                self._note_chunk(begin, min(size, self._file.size - begin))
                indexed = False
            if begin + size > self._file.size:
                break
            if operation == _MESSAGE_INDEX:
                indexed = True
                self._note_index(self._file.read(begin, size))
            elif operation in (_SCHEMA, _CHANNEL, _ATTACHMENT):
                self._declare(operation, self._file.read(begin, size))
            elif operation == _MESSAGE:
                number, _, recorded, _ = _MESSAGE_LEAD.unpack(
                    self._file.read(begin, _MESSAGE_LEAD.size)
                )
                self._entries.setdefault(number, []).append((recorded, -1, position))
            elif operation == _FOOTER:
                ended = True
                break
            position = begin + size
        if not indexed:
            self._go_through(len(self._chunks) - 1)
        if not ended:
            self.doubts.append("is cut off: its end is missing")
        if set(self._entries) - set(self._channels):
            for chunk in range(len(self._chunks)):  # channels stand in the chunks as well
                self._go_through(chunk, declarations_only=True)

    def _note_chunk(self, begin: int, size: int) -> None:
        head = self._file.read(begin, min(_CHUNK_HEAD, size))
        if len(head) < _CHUNK_LEAD.size:
            self._chunks.append(_Chunk("", begin, 0))
            return
        *_, length = _CHUNK_LEAD.unpack_from(head)
        name = head[_CHUNK_LEAD.size : _CHUNK_LEAD.size + length].decode("ascii", "replace")
        lead = _CHUNK_LEAD.size + length + 8
        self._chunks.append(_Chunk(name, begin + lead, max(0, size - lead)))

    def _note_index(self, data: bytes) -> None:
        number = _U16.unpack_from(data)[0]
        size = _U32.unpack_from(data, 2)[0]
        chunk = len(self._chunks) - 1
        entries = self._entries.setdefault(number, [])
        for recorded, offset in _INDEX_ENTRY.iter_unpack(data[6 : 6 + size]):
            entries.append((recorded, chunk, offset))

    def _note_attachment(self, data: bytes) -> None:
        times = 2 * _U64.size
        name, media_type = _texts(data, times, 2)
        begin = times + 2 * _U32.size + len(name.encode()) + len(media_type.encode())
        length = _U64.unpack_from(data, begin)[0]
        self.attachments[name] = data[begin + _U64.size : begin + _U64.size + length]

    def _declare(self, operation: int, data: bytes) -> None:
        if operation == _ATTACHMENT:
            self._note_attachment(data)
            return
        if operation == _SCHEMA:
            self._schemas[_U16.unpack_from(data)[0]] = _texts(data, 2, 1)[0]
            return
        number, schema = struct.unpack_from("<HH", data)
        topic, encoding = _texts(data, 4, 2)
        kind = normal_kind(self._schemas.get(schema, ""))
        self._channels[number] = Channel(normal_topic(topic), kind, encoding)

    def _go_through(self, chunk: int, *, declarations_only: bool = False) -> None:
        """Read the index entries from the chunk itself."""
        try:
            content = self._cache[chunk]
        except DatasetError as error:
            self.doubts.append(f"cannot be read to its end: {error}")
            return
        for position, operation, begin, size in _records(content):
            if operation in (_SCHEMA, _CHANNEL):
                self._declare(operation, content[begin : begin + size])
            elif operation == _MESSAGE and not declarations_only:
                number, _, recorded, _ = _MESSAGE_LEAD.unpack_from(content, begin)
                self._entries.setdefault(number, []).append((recorded, chunk, position))

    def _place(self, recorded: int, chunk: int, position: int) -> Place | None:
        """Find the message after the header of its record; None if it is incomplete."""
        if chunk >= 0 and self._chunks[chunk].compression == "":
            end = self._chunks[chunk].position + self._chunks[chunk].size
            position, chunk = position + self._chunks[chunk].position, -1
        elif chunk >= 0:
            end = len(self._cache[chunk])
        else:
            end = self._file.size
        lead = self._part(chunk, position, _LEAD.size)
        if len(lead) < _LEAD.size:
            return None
        operation, size = _LEAD.unpack(lead)
        begin = position + _LEAD.size + _MESSAGE_LEAD.size
        size -= _MESSAGE_LEAD.size
        if operation != _MESSAGE or size < 0 or begin + size > end:
            return None
        return Place(recorded, chunk, begin, size)

    def _part(self, chunk: int, position: int, size: int) -> bytes:
        if chunk < 0:
            return self._file.read(position, size)
        return self._cache[chunk][position : position + size]

    def _load_chunk(self, number: int) -> bytes:
        chunk = self._chunks[number]
        return decompress(self._file.read(chunk.position, chunk.size), chunk.compression)


def _texts(data: bytes, position: int, count: int) -> list[str]:
    """Read consecutive texts, each after its length."""
    texts = []
    for _ in range(count):
        size = _U32.unpack_from(data, position)[0]
        texts.append(data[position + 4 : position + 4 + size].decode("utf-8", "replace"))
        position += 4 + size
    return texts


def _records(content: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Yield the complete records of a chunk: position, operation, and data."""
    position = 0
    while position + _LEAD.size <= len(content):
        operation, size = _LEAD.unpack_from(content, position)
        begin = position + _LEAD.size
        if begin + size > len(content):
            return
        yield position, operation, begin, size
        position = begin + size
