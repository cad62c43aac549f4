# SPDX-License-Identifier: BSD-3-Clause
"""Writing of map files: complete ones first, then changes, one commit each."""

from __future__ import annotations

import contextlib
import logging
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Set
from pathlib import Path
from types import MappingProxyType

from orbslam2py._arguments import path_of
from orbslam2py._files import reason_of, take_mode, temporary_beside
from orbslam2py.errors import MapFileError
from orbslam2py.maps.map_rows import Row, checksum
from orbslam2py.maps.schema import (
    APPLICATION_ID,
    HEADER_SIZE,
    TABLES,
    Table,
    application_of,
    create_script,
)

_log = logging.getLogger(__name__)

#: Tables whose rows stay once they are written, although they are not given again.
WRITTEN_ONCE = frozenset({"keypoints", "images", "frames", "runs", "settings", "vocabulary"})

#: Seconds that a writer or reader waits for another program that has the file locked.
LOCK_PATIENCE = 2.0

_OLDEST_SQLITE = (3, 37, 0)
_SIDE_FILES = ("-wal", "-shm", "-journal")


def _upsert(table: Table) -> str:
    """Insert a row, or update it in place: a replacement would delete rows that refer to it."""
    marks = ", ".join("?" * len(table.columns))
    changes = ", ".join(
        f"{column} = excluded.{column}" for column in table.columns if column not in table.keys
    )
    return (
        f"INSERT INTO {table.name} VALUES ({marks}) "
        f"ON CONFLICT ({', '.join(table.keys)}) DO UPDATE SET {changes}"
    )


_UPSERT = {name: _upsert(table) for name, table in TABLES.items()}


class MapWriter:
    """Updates a map file commit by commit.

    The first `commit` writes a separate file, which replaces `path` when it is complete; later ones
    change only the rows that differ. After a crash the file contains the last commit. Use it in one
    thread at a time, and `close` it at the end.

    Parameters
    ----------
    path
        The map file; replaced by the first commit.
    once
        There will be only one commit: the file does not change after it is in its place.

    Attributes
    ----------
    path : Path
        The file itself, if `path` is a link.
    begun : bool
        Whether the file may contain the committed data, even if a later step failed.
    """

    def __init__(self, path: str | os.PathLike[str], *, once: bool = False) -> None:
        self._once = once
        self.path = Path(os.path.realpath(path))
        self.begun = False
        self._named = str(path)
        #: To the file that the first commit has put in its place. As long as there is none, nothing
        #: counts as written: the next commit replaces the file, and has to be all of it.
        self._connection: sqlite3.Connection | None = None
        #: Checksum of every row in the file, by table and key.
        self._written = _nothing()

    def has(self, table: str, *key: int) -> bool:
        """Return whether the file has a row."""
        return key in self._written[table]

    def keys(self, table: str) -> Set[Row]:
        """Return the keys of the rows in the file."""
        return self._written[table].keys()

    def commit(
        self,
        rows: Iterable[tuple[str, Row]],
        kept: Mapping[str, Set[Row]] = MappingProxyType({}),
    ) -> int:
        """Write these rows in one transaction; return how many were written.

        Rows of variable tables that are not given are deleted. Rows of other tables are kept,
        except keypoints and images of removed keyframes.

        Parameters
        ----------
        rows
            (table, row) pairs.
        kept
            Keys of rows to keep although they are not given, by table.

        Raises
        ------
        MapFileError
            If the file cannot be written; the earlier contents are kept.
        """
        with _naming(self._named):
            if self._connection is None:
                return self._commit_first(rows)
            return self._change(self._connection, rows, kept)

    def close(self) -> None:
        """End with a single file without a log; further calls do nothing.

        If another program has the file open, the log remains, with a warning: both files together
        contain all commits. If a Ctrl-C interrupts it, the file is still open; it can be written
        and closed.

        Raises
        ------
        MapFileError
            If commits may not have reached the disk. The file is closed in any case.
        """
        connection = self._connection
        if connection is None:
            return
        try:
            with _naming(self._named):
                self._end_log(connection)
        except Exception:
            self._disconnect(connection)
            raise
        self._disconnect(connection)

    def _end_log(self, connection: sqlite3.Connection) -> None:
        try:
            connection.execute("PRAGMA journal_mode = DELETE")
        except sqlite3.OperationalError as error:
            if "locked" not in str(error):
                raise
            # As much as the readers let through: less is lost if the file is copied alone.
            connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
            _log.warning(
                "another program has %s open; keep %s-wal beside it, it belongs to the map",
                self._named,
                self.path.name,
            )

    def _disconnect(self, connection: sqlite3.Connection) -> None:
        self._connection, self._written = None, _nothing()
        connection.close()

    def _commit_first(self, rows: Iterable[tuple[str, Row]]) -> int:
        _check_target(self.path, self._named)
        temporary = temporary_beside(self.path)
        try:
            with contextlib.closing(connect(temporary, "rwc")) as connection:
                take_mode(temporary, self.path)  # before anything private is in it
                # The temporary file is not read by others, so it needs no journal.
                connection.execute("PRAGMA journal_mode = OFF")
                connection.execute("PRAGMA synchronous = OFF")
                connection.executescript(create_script())
                n = self._change(connection, rows, {})
                if not self._once:
                    # Readers see the last commit while the next is written, also after a crash.
                    # Switched on here, where a kill does no harm.
                    connection.execute("PRAGMA journal_mode = WAL")
            _sync(temporary)
            _end_old_log(self.path)
            self.begun = True
            temporary.replace(self.path)
            _sync(self.path.parent)
            if not self._once:
                connection = connect(self.path, "rw")
                connection.execute("PRAGMA synchronous = NORMAL")
                self._connection = connection
        except BaseException:
            self._written = _nothing()
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
        return n

    def _change(
        self,
        connection: sqlite3.Connection,
        rows: Iterable[tuple[str, Row]],
        kept: Mapping[str, Set[Row]],
    ) -> int:
        written = {name: dict(known) for name, known in self._written.items()}
        seen: dict[str, set[Row]] = {name: set() for name in TABLES}
        n, complete = 0, False
        try:
            connection.execute("BEGIN IMMEDIATE")
            for name, row in rows:
                table = TABLES[name]
                key, total = row[: len(table.keys)], checksum(row)
                seen[name].add(key)
                if written[name].get(key) == total:
                    continue
                written[name][key] = total
                connection.execute(_UPSERT[name], (*row, total))
                n += 1
            for name, key in _others(written, seen, kept):
                _delete(connection, name, key)
                del written[name][key]
                n += 1
            if n:
                _write_totals(connection, written)
            complete = True
            connection.execute("COMMIT")
        except sqlite3.Error:
            _roll_back(connection)
            raise
        except BaseException:
            # A Ctrl-C that comes while SQLite commits is heard when that is done.
            if complete and not connection.in_transaction:
                self._written = written
            _roll_back(connection)
            raise
        self._written = written
        return n


def _nothing() -> dict[str, dict[Row, int]]:
    return {name: {} for name in TABLES}


def _roll_back(connection: sqlite3.Connection) -> None:
    with contextlib.suppress(sqlite3.Error):  # maybe it has not begun, or SQLite has done it
        connection.execute("ROLLBACK")


def connect(path: Path, mode: str) -> sqlite3.Connection:
    """Open a database file; the caller begins and ends transactions.

    Parameters
    ----------
    path
        The file.
    mode
        ``ro``, ``rw`` or ``rwc``, as in SQLite's file names.
    """
    if sqlite3.sqlite_version_info < _OLDEST_SQLITE:
        raise MapFileError(
            f"map files need SQLite 3.37, this Python has {sqlite3.sqlite_version}; use a newer one"
        )
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode={mode}",
        uri=True,
        timeout=LOCK_PATIENCE,
        isolation_level=None,
        check_same_thread=False,
    )
    connection.execute("PRAGMA foreign_keys = ON")
    return connection


def _others(
    written: dict[str, dict[Row, int]],
    seen: dict[str, set[Row]],
    kept: Mapping[str, Set[Row]],
) -> list[tuple[str, Row]]:
    """Return rows of the file that the map no longer has; keypoints before their keyframes."""
    gone = [
        (name, key)
        for name, known in written.items()
        if name not in WRITTEN_ONCE
        for key in known.keys() - seen[name] - kept.get(name, frozenset())
    ]
    dead = {key for name, key in gone if name == "keyframes"}
    hanging = [(name, key) for name in ("keypoints", "images") for key in dead & set(written[name])]
    return [*hanging, *gone]


def _delete(connection: sqlite3.Connection, name: str, key: Row) -> None:
    where = " AND ".join(f"{column} = ?" for column in TABLES[name].keys)
    connection.execute(f"DELETE FROM {name} WHERE {where}", key)


def _write_totals(connection: sqlite3.Connection, written: dict[str, dict[Row, int]]) -> None:
    totals = [(name, len(rows), sum(rows.values())) for name, rows in written.items()]
    connection.executemany("INSERT OR REPLACE INTO totals VALUES (?, ?, ?)", totals)


# ---- the file ---------------------------------------------------------------------------------
@contextlib.contextmanager
def _naming(path: str) -> Iterator[None]:
    """Return a message that names the file and says why it could not be written."""
    try:
        yield
    except sqlite3.IntegrityError as error:
        raise MapFileError(f"cannot write {path}: the map is inconsistent ({error})") from error
    except sqlite3.Error as error:
        raise MapFileError(f"cannot write {path}: {_remedy_for(str(error))}") from error
    except OSError as error:
        raise MapFileError(f"cannot write {path}: {_advice(error)}") from error


def _advice(error: OSError) -> str:
    reason = reason_of(error)
    if isinstance(error, PermissionError):
        return f"{reason}; choose a place where you may write"
    if isinstance(error, FileNotFoundError):
        return f"{reason}; make the folder first"
    return f"{reason}; a file that was there is kept"


def _remedy_for(message: str) -> str:
    if "locked" in message:
        return "another program is writing it; wait for it or choose another name"
    if "full" in message:
        return "the disk is full; make room, a file that was there is kept"
    if "readonly" in message or "unable to open" in message:
        return "the folder or the file is not writable; choose another place"
    return f"{message}; a file that was there is kept"


def check_map_target(path: str | os.PathLike[str]) -> None:
    """Raise `MapFileError` if a map file cannot be written there; for use before there is a map."""
    named = str(path_of(path, "the map file", MapFileError))
    target = Path(os.path.realpath(path))
    with _naming(named):
        _check_target(target, named)
        probe = temporary_beside(target)
        probe.touch()
        probe.unlink()


def _check_target(path: Path, named: str) -> None:
    if not path.parent.is_dir():
        raise MapFileError(f"cannot write {named}: no such folder; make the folder first")
    if path.is_dir():
        raise MapFileError(f"cannot write {named}: it is a folder; give the name of a file")
    if path.exists() and not path.is_file():
        raise MapFileError(f"cannot write {named}: it is a device; give the name of a file")
    if not path.exists():
        return
    if not os.access(path, os.W_OK):
        raise MapFileError(f"cannot write {named}: it is read-only; choose another name")
    with path.open("rb") as stream:
        header = stream.read(HEADER_SIZE)
    if not header:
        return
    if application_of(header) != APPLICATION_ID:
        raise MapFileError(
            f"cannot write {named}: it is there and is no map file; choose another name, or "
            "remove it first"
        )
    with contextlib.closing(connect(path, "rw")) as connection:
        try:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("ROLLBACK")
        except sqlite3.DatabaseError as error:
            if "locked" in str(error):
                raise


def _end_old_log(path: Path) -> None:
    """Move the log of a killed writer into the file that will be replaced.

    Otherwise it would count as the log of the new file.
    """
    logs = [path.with_name(f"{path.name}{suffix}") for suffix in _SIDE_FILES]
    if path.exists() and any(log.exists() for log in logs):
        with (
            contextlib.suppress(sqlite3.Error, OSError),
            contextlib.closing(connect(path, "rw")) as connection,
        ):
            connection.execute("PRAGMA journal_mode = DELETE")
    for log in logs:
        with contextlib.suppress(FileNotFoundError):
            log.unlink()


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
