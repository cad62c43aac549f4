# SPDX-License-Identifier: BSD-3-Clause
"""Reading map files: nothing in them is trusted."""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from orbslam2py import _core as core
from orbslam2py._files import reason_of
from orbslam2py.errors import MapFileError, SettingsError
from orbslam2py.maps.map_rows import Row
from orbslam2py.maps.map_tables import join_blobs, read_contents, read_one, read_rows
from orbslam2py.maps.map_writer import connect
from orbslam2py.maps.saved_map import RecordedFrames, Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.schema import APPLICATION_ID, CREATE, FORMAT_VERSION, TABLES, Table
from orbslam2py.settings.keys import ORIGINAL_COORDINATES
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings

_Group = TypeVar("_Group")

_WRITTEN_BY = "give a file that 'orbslam2py run --save' or save_map has written"
_COPY = "use a copy of the file"

#: Characters of what is quoted in a message.
_LONGEST = 200


def load_map(path: str | os.PathLike[str], *, images: bool = False) -> SavedMap:
    """Read a map file.

    Everything is checked: checksums, counts, sizes, references, ranges. What is returned can be
    used.

    Parameters
    ----------
    path
        The file. It is not changed; another program may be writing it.
    images
        Also read the keyframes' images.

    Raises
    ------
    MapFileError
        Naming the file, what is wrong and what can be done about it.
    """
    named, file = str(path), Path(path)
    _check_header(file, named)
    with _refusing(named):
        # A writer that was killed may have left a journal: SQLite takes back what it says first.
        interrupted = file.with_name(f"{file.name}-journal").exists()
        with contextlib.closing(connect(file, "rw" if interrupted else "ro")) as connection:
            connection.execute("PRAGMA cell_size_check = ON")
            connection.execute("BEGIN")  # all tables as of one commit
            _check_schema(connection)
            saved = _read(connection, images=images)
        core.check_map_contents(saved.contents.as_dict())
        _check_frames(saved)
    return replace(saved, source=named)


def _check_header(path: Path, named: str) -> None:
    """Tell what a file is by its first bytes, before SQLite looks at it."""
    try:
        if path.is_dir():
            raise MapFileError(f"{named} is a folder; give the map file itself")
        size = path.stat().st_size
        with path.open("rb") as stream:
            header = stream.read(100)
    except FileNotFoundError:
        raise MapFileError(f"there is no map file {named}; check the name") from None
    except OSError as error:
        raise MapFileError(f"cannot read {named}: {reason_of(error)}; check the file") from error
    if size == 0:
        raise MapFileError(f"{named} is empty; {_COPY}, or save the map again")
    if len(header) < 100 or not header.startswith(b"SQLite format 3\x00"):
        raise MapFileError(f"{named} is not a map file; {_WRITTEN_BY}")
    if int.from_bytes(header[68:72], "big") != APPLICATION_ID:
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


@contextlib.contextmanager
def _refusing(named: str) -> Iterator[None]:
    """Say which file is wrong, and what to do."""
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
    """What an error says, however much of a damaged file it quotes."""
    text = " ".join(str(error).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def _check_schema(connection: sqlite3.Connection) -> None:
    with contextlib.closing(sqlite3.connect(":memory:")) as model:
        model.executescript(CREATE)
        query = "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"
        if connection.execute(query).fetchall() != model.execute(query).fetchall():
            raise MapFileError("its tables are not those of a map file")


def _read(connection: sqlite3.Connection, *, images: bool) -> SavedMap:
    sensor, yaml = read_one(connection, "settings")[1:]
    if sensor not in {member.value for member in Sensor}:
        raise MapFileError(f"it names a sensor that is not known, '{sensor}'")
    name, content_hash, comment = read_one(connection, "vocabulary")[1:]
    runs = tuple(_read_runs(connection))
    contents = read_contents(connection)
    pictures = read_rows(connection, TABLES["images"]) if images else []
    return SavedMap(
        contents,
        _settings_of(yaml, Sensor(sensor)),
        VocabularyIdentity(name, content_hash, comment),
        runs,
        dict(pictures),
    )


def _settings_of(yaml: str, sensor: Sensor) -> Settings:
    settings = Settings.from_yaml(yaml, sensor)
    if ORIGINAL_COORDINATES in yaml:
        return settings
    # A map from before there was a choice: its keypoints lie where the original puts them.
    return replace(settings, orb=replace(settings.orb, original_coordinates=True))


def _read_runs(connection: sqlite3.Connection) -> Iterator[Run]:
    frames: dict[int, list[Row]] = {}
    for run, _part, *rest in read_rows(connection, TABLES["frames"]):
        frames.setdefault(run, []).append((run, *rest))
    table = Table("frames", ("run",), (), TABLES["frames"].blobs)
    for number, program, started, seed, options in read_rows(connection, TABLES["runs"]):
        arrays = join_blobs(table, frames.pop(number, []))
        try:
            chosen = json.loads(options)
        except ValueError:
            chosen = None
        if not isinstance(chosen, dict):
            raise MapFileError(f"the options of run {number} are not readable")
        yield Run(program, started, seed, chosen, RecordedFrames(**arrays))
    if frames:
        raise MapFileError("there are frames of a run that is not there")


def _check_frames(saved: SavedMap) -> None:
    contents = saved.contents
    known = np.concatenate([contents.keyframes.ids, contents.removed_keyframes.ids, [-1]])
    for number, run in enumerate(saved.runs):
        frames = run.frames
        good = (
            np.isin(frames.keyframes, known).all()
            and np.isfinite(frames.timestamps).all()
            and np.isfinite(frames.T_cr).all()
            and np.allclose(np.linalg.norm(frames.T_cr[:, :4], axis=1), 1, atol=1e-6)
        )
        if not good:
            raise MapFileError(f"the trajectory of run {number} has a frame out of range")
