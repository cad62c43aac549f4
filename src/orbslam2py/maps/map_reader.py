# SPDX-License-Identifier: BSD-3-Clause
"""Reading of map files, with checks of all contents."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import path_of
from orbslam2py._arrays import IntArray
from orbslam2py._files import reason_of
from orbslam2py.errors import MapFileError, SettingsError
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.imu_states import check_states
from orbslam2py.maps.map_copies import living_roots
from orbslam2py.maps.map_tables import BlobTable, MapTables, read_one, read_rows
from orbslam2py.maps.map_writer import connect
from orbslam2py.maps.saved_map import RecordedFrames, Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.schema import (
    APPLICATION_ID,
    FORMAT_VERSION,
    HEADER_SIZE,
    IN_METRES,
    UPRIGHT,
    Table,
    application_of,
    create_script,
    tables_of,
)
from orbslam2py.settings.keys import ORIGINAL_COORDINATES
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings

_WRITTEN_BY = "give a file that 'orbslam2py run --save' or save_map has written"
_COPY = "use a copy of the file"

#: Length of a quotation in a message, characters.
_LONGEST = 200

#: A keyframe's number, as far as 64 bits hold one.
_ID = re.compile(r"[0-9]{1,18}")


def load_map(path: str | os.PathLike[str], *, images: bool = False) -> SavedMap:
    """Read a map file.

    Checks cover checksums, counts, sizes, references and ranges. The result can be used without
    further checks.

    Parameters
    ----------
    path
        The file. The file; it is only read, and another program may write it.
    images
        Whether to read the images of the keyframes too.

    Raises
    ------
    MapFileError
        The message names the file, the fault and a remedy.
    """
    named = str(path)
    with opened(path) as (connection, tables):
        head = read_head(connection, tables, images=images)
        contents = MapTables(connection, tables).contents()
        check_contents(contents, head.runs)
    contents = replace(
        contents,
        metric_roots=living_roots(head.metric_roots, contents.keyframes),
        upright_roots=living_roots(head.upright_roots, contents.keyframes),
    )
    return SavedMap(contents, head.settings, head.vocabulary, head.runs, head.images, source=named)


@contextlib.contextmanager
def opened(
    path: str | os.PathLike[str],
) -> Iterator[tuple[sqlite3.Connection, dict[str, Table]]]:
    """Open a map file for reading, in the state of one commit.

    Yields
    ------
    connection, tables
        The connection to the database, and its tables.

    Raises
    ------
    MapFileError
        The message names the file; also for faults found while it is open.
    """
    file = path_of(path, "the map file", MapFileError)
    named = str(path)
    version = _check_header(file, named)
    with _refusing(named):
        # A writer that was killed may have left a journal: SQLite corrects its first report.
        interrupted = file.with_name(f"{file.name}-journal").exists()
        with contextlib.closing(connect(file, "rw" if interrupted else "ro")) as connection:
            connection.execute("PRAGMA cell_size_check = ON")
            connection.execute("BEGIN")  # all tables as of one commit
            # Of a file that is being written the header may be older than what the log says.
            version = max(version, connection.execute("PRAGMA user_version").fetchone()[0])
            _check_schema(connection, version)
            yield connection, tables_of(version)


def _check_header(path: Path, named: str) -> int:
    """Check a file by its first bytes before SQLite reads it; return its version."""
    try:
        if path.is_dir():
            raise MapFileError(f"{named} is a folder; give the map file itself")
        size = path.stat().st_size
        with path.open("rb") as stream:
            header = stream.read(HEADER_SIZE)
    except FileNotFoundError:
        raise MapFileError(f"there is no map file {named}; check the name") from None
    except OSError as error:
        raise MapFileError(f"cannot read {named}: {reason_of(error)}; check the file") from error
    if size == 0:
        raise MapFileError(f"{named} is empty; {_COPY}, or save the map again")
    application = application_of(header)
    if application is None:
        raise MapFileError(f"{named} is not a map file; {_WRITTEN_BY}")
    if application != APPLICATION_ID:
        raise MapFileError(f"{named} is a database of another program; {_WRITTEN_BY}")
    version = int.from_bytes(header[60:64], "big")
    if version > FORMAT_VERSION:
        raise MapFileError(
            f"{named} has version {version} of the format, this program knows {FORMAT_VERSION}; "
            "update orbslam2py"
        )
    page = int.from_bytes(header[16:18], "big")
    expected = (65536 if page == 1 else page) * int.from_bytes(header[28:32], "big")
    if size < expected and not path.with_name(f"{path.name}-wal").exists():
        raise MapFileError(
            f"{named} is cut short: {size} of {expected} bytes; {_COPY}, or save the map again"
        )
    return version


@contextlib.contextmanager
def _refusing(named: str) -> Iterator[None]:
    """Make an error that names the file, the fault and a remedy."""
    try:
        yield
    except MapFileError as error:
        problem = _one_line(error)
        raise MapFileError(f"{named}: {problem}; the file is damaged, {_COPY}") from error
    except (sqlite3.Error, UnicodeError) as error:
        if "locked" in str(error):
            raise MapFileError(f"{named} is locked by another program; wait for it") from error
        raise MapFileError(f"{named} cannot be read: {_one_line(error)}; {_COPY}") from error
    except SettingsError as error:
        problem = _one_line(error)
        raise MapFileError(f"{named}: its settings are wrong: {problem}; {_COPY}") from error


def _one_line(error: Exception) -> str:
    """Return the text of an error, shortened if it quotes a damaged file."""
    text = " ".join(str(error).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def _check_schema(connection: sqlite3.Connection, version: int) -> None:
    with contextlib.closing(sqlite3.connect(":memory:")) as model:
        model.executescript(create_script(version))
        query = "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"
        if connection.execute(query).fetchall() != model.execute(query).fetchall():
            raise MapFileError("its tables are not those of a map file")


class Head(NamedTuple):
    """The description of a map, as in `SavedMap`."""

    settings: Settings
    vocabulary: VocabularyIdentity
    runs: tuple[Run, ...]
    images: dict[int, bytes]
    metric_roots: tuple[int, ...]
    upright_roots: tuple[int, ...]
    """Both as in `MapContents`; the caller checks that they are roots."""


def read_head(connection: sqlite3.Connection, tables: dict[str, Table], *, images: bool) -> Head:
    """Return all but the map itself."""
    sensor, yaml = read_one(connection, tables["settings"])[1:]
    if sensor not in {member.value for member in Sensor}:
        raise MapFileError(f"it names a sensor that is not known, '{sensor}'")
    identity = VocabularyIdentity(*read_one(connection, tables["vocabulary"])[1:])
    runs = tuple(_read_runs(connection, tables))
    pictures = read_rows(connection, tables["images"]) if images else []
    settings = _settings_of(yaml, Sensor(sensor))
    roots = (_roots_of(yaml, IN_METRES), _roots_of(yaml, UPRIGHT))
    return Head(settings, identity, runs, dict(pictures), *roots)


def _roots_of(yaml: str, begin: str) -> tuple[int, ...]:
    """Keyframes in the line that begins so."""
    lines = [line for line in yaml.splitlines() if line.startswith(begin)]
    words = lines[-1].removeprefix(begin).split() if lines else []
    return tuple(sorted({int(word) for word in words if _ID.fullmatch(word)}))


def _settings_of(yaml: str, sensor: Sensor) -> Settings:
    settings = Settings.from_yaml(yaml, sensor)
    if ORIGINAL_COORDINATES in yaml:
        return settings
    # A map from before there was a choice: its keypoints lie where the original puts them.
    return replace(settings, orb=replace(settings.orb, original_coordinates=True))


def _read_runs(connection: sqlite3.Connection, tables: dict[str, Table]) -> Iterator[Run]:
    frames = BlobTable(connection, tables["frames"])
    arrays = frames.whole()
    ends = np.cumsum(frames.counts)
    rows = read_rows(connection, tables["runs"])
    if not np.isin(frames.keys[:, 0], [row[0] for row in rows]).all():
        raise MapFileError("there are frames of a run that is not there")
    for number, program, started, seed, options in rows:
        begin, end = np.searchsorted(frames.keys[:, 0], [number, number + 1])
        first, last = (int(ends[row - 1]) if row else 0 for row in (begin, end))
        try:
            chosen = json.loads(options)
        except ValueError:
            chosen = None
        if not isinstance(chosen, dict):
            raise MapFileError(f"the options of run {number} are not readable")
        recorded = {name: array[first:last].copy() for name, array in arrays.items()}
        yield Run(program, started, seed, chosen, RecordedFrames(**recorded))


def check_contents(contents: MapContents, runs: tuple[Run, ...]) -> None:
    """Raise `MapFileError` with the fault, unless this can be a map with its runs."""
    core.check_map_contents(contents.as_dict())
    check_states(contents.imu_states, contents.keyframes.ids, contents.keyframes.timestamps)
    check_frames(runs, contents.keyframes.ids, contents.removed_keyframes.ids)


def check_frames(runs: tuple[Run, ...], keyframes: IntArray, removed: IntArray) -> None:
    """Raise `MapFileError` unless the frames of all runs are poses relative to these keyframes."""
    known = np.concatenate([keyframes, removed, [-1]])
    for number, run in enumerate(runs):
        frames = run.frames
        with np.errstate(over="ignore"):  # infinite is not 1
            lengths = np.linalg.norm(frames.T_cr[:, :4], axis=1)
        good = (
            np.isin(frames.keyframes, known).all()
            and np.isfinite(frames.timestamps).all()
            and np.isfinite(frames.T_cr).all()
            and np.allclose(lengths, 1, atol=1e-6)
        )
        if not good:
            raise MapFileError(f"the trajectory of run {number} has a frame out of range")
