# SPDX-License-Identifier: BSD-3-Clause
"""SQLite files of ROS 2: a table of topics and a table of messages."""

from __future__ import annotations

import contextlib
import sqlite3
import sys
import threading
from pathlib import Path
from typing import Any

from orbslam2py._arguments import cannot_open, number_of
from orbslam2py.datasets.bags.libraries import ZSTD_MAGIC, zstd_decompress
from orbslam2py.datasets.bags.parts import (
    Channel,
    Place,
    count_messages,
    entries_of,
    normal_kind,
    normal_topic,
)
from orbslam2py.errors import DatasetError

MAGIC = b"SQLite format 3\0"


class SqliteFile:
    """A database of rosbag2; see `parts.BagFile`.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    DatasetError
        If it is no database, or not one of rosbag2.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.doubts: list[str] = []
        self._lock = threading.Lock()
        self._database = self._open()
        tables = {
            name for (name,) in self._rows("SELECT name FROM sqlite_master WHERE type='table'")
        }
        if not {"topics", "messages"} <= tables:
            raise DatasetError(
                f"{path} is a database, but no bag of ROS 2: it has no tables 'topics' and "
                "'messages'; give the file that 'ros2 bag record' wrote"
            )
        self._channels: dict[int, Channel] = {}
        self._list_topics()
        self._entries: dict[int, list[tuple[int, int]]] = {}
        self._list_messages()

    def counts(self) -> dict[Channel, int]:
        """Return the channels and their numbers of messages."""
        return count_messages(self._channels, self._entries)

    def places(self, channel: Channel) -> list[Place]:
        """Return the positions of the messages of a channel, in the order of recording."""
        entries = entries_of(channel, self._channels, self._entries)
        return [Place(recorded, -1, row, 0) for recorded, row in sorted(entries)]

    def read(self, place: Place, most: int | None = None) -> bytes:
        """Read a message, or its first bytes.

        Raises
        ------
        DatasetError
            If the database is damaged at this position.
        """
        try:
            with self._lock:
                content = self._first_bytes(place.offset, most)
                if content.startswith(ZSTD_MAGIC):  # single messages may be compressed
                    return zstd_decompress(self._first_bytes(place.offset, None), most)
        except (sqlite3.Error, OSError) as error:
            raise DatasetError(f"a message of {self.path} cannot be read: {error}") from error
        return content

    def _first_bytes(self, row: int, most: int | None) -> bytes:
        if most is not None and sys.version_info >= (3, 11):
            # Reads the first page of a message, where a query would read all of it.
            with self._database.blobopen("messages", "data", row, readonly=True) as blob:
                return blob.read(most)
        query = "SELECT data FROM messages WHERE id = ?"
        content, *_ = self._database.execute(query, (row,)).fetchone() or (None,)
        if not isinstance(content, bytes):
            raise DatasetError(f"a message of {self.path} cannot be read: it holds no bytes")
        return content if most is None else content[:most]

    def _open(self) -> sqlite3.Connection:
        try:
            with self.path.open("rb") as stream:
                start = stream.read(len(MAGIC))
        except OSError as error:
            raise DatasetError(cannot_open(self.path, error)) from error
        if start != MAGIC:
            raise DatasetError(
                f"{self.path} is no SQLite database: it does not begin like one; copy it again"
            )
        address = self.path.absolute().as_uri()
        # Read beside a program that writes it; where that is not allowed, as it lies there.
        for mode in ("mode=ro", "immutable=1"):
            with contextlib.suppress(sqlite3.OperationalError):
                database = sqlite3.connect(f"{address}?{mode}", uri=True, check_same_thread=False)
                database.text_factory = lambda text: text.decode("utf-8", "replace")
                try:
                    database.execute("SELECT count(*) FROM sqlite_master").fetchone()
                except sqlite3.OperationalError:
                    database.close()
                    raise
                except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
                    # Without it, a file that is shorter than its header says cannot be opened.
                    database.execute("PRAGMA writable_schema = ON")
                    self._doubt(error)
                return database
        raise DatasetError(f"{self.path} is a database that cannot be opened; copy it again")

    def _rows(self, query: str) -> list[tuple[Any, ...]]:
        try:
            return self._database.execute(query).fetchall()
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise DatasetError(
                f"{self.path} is damaged or cut off ({_reason(error)}); copy it again"
            ) from error

    def _list_topics(self) -> None:
        query = "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
        nameless = 0
        for number, *texts in self._rows(query):
            if all(isinstance(text, str) for text in texts):
                topic, kind, encoding = texts
                channel = Channel(normal_topic(topic), normal_kind(kind), encoding)
                self._channels[number] = channel
            else:  # a damaged table may hold anything, or nothing
                nameless += 1
        if nameless:
            named = number_of(nameless, "topic")
            self.doubts.append(f"is damaged: {named} without a name or a type, left out")

    def _list_messages(self) -> None:
        """Store time and row of each message that can be read."""
        query = "SELECT id, topic_id, timestamp FROM messages ORDER BY id"
        untimed = 0
        try:
            for row, topic, recorded in self._database.execute(query):
                if isinstance(recorded, int):
                    self._entries.setdefault(topic, []).append((recorded, row))
                else:
                    untimed += 1
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            if not self.doubts:
                self._doubt(error)
        if untimed:
            named = number_of(untimed, "message")
            self.doubts.append(f"is damaged: {named} without a time, left out")

    def _doubt(self, error: Exception) -> None:
        self.doubts.append(f"is damaged or cut off ({_reason(error)}); read as far as it goes")


def _reason(error: Exception) -> str:
    """Return the error of SQLite, without bytes that are no text."""
    return str(error) if isinstance(error, sqlite3.Error) else "malformed database"
