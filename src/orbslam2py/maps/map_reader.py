# SPDX-License-Identifier: BSD-3-Clause
"""Reading map files: nothing in them is trusted."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from orbslam2py import _core as core
from orbslam2py._files import reason_of
from orbslam2py.errors import MapFileError, SettingsError
from orbslam2py.maps.contents import (
    Cameras,
    Covisibility,
    Keyframes,
    MapContents,
    Observations,
    Points,
    RemovedKeyframes,
)
from orbslam2py.maps.map_rows import Row, checksum
from orbslam2py.maps.map_writer import connect
from orbslam2py.maps.saved_map import RecordedFrames, Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.schema import APPLICATION_ID, CREATE, FORMAT_VERSION, TABLES, Table
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings

_Group = TypeVar("_Group")

_COPY = "use a copy of the file"


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
        with contextlib.closing(connect(file, "ro")) as connection:
            connection.execute("PRAGMA cell_size_check = ON")
            connection.execute("BEGIN")  # all tables as of one commit
            _check_schema(connection)
            saved = _read(connection, images=images)
        core.check_map_contents(saved.contents.as_dict())
        _check_frames(saved)
    return dataclasses.replace(saved, source=named)


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
        raise MapFileError(f"{named} is not a map file; give a file that save_map has written")
    if int.from_bytes(header[68:72], "big") != APPLICATION_ID:
        raise MapFileError(
            f"{named} is a database of another program; give a file that save_map has written"
        )
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
        raise MapFileError(f"{named}: {error}; the file is damaged, {_COPY}") from error
    except sqlite3.Error as error:
        if "locked" in str(error):
            raise MapFileError(f"{named} is locked by another program; wait for it") from error
        raise MapFileError(f"{named} cannot be read: {error}; {_COPY}") from error
    except SettingsError as error:
        problem = " ".join(str(error).split())
        raise MapFileError(f"{named}: its settings are wrong: {problem}; {_COPY}") from error


def _check_schema(connection: sqlite3.Connection) -> None:
    with contextlib.closing(sqlite3.connect(":memory:")) as model:
        model.executescript(CREATE)
        query = "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"
        if connection.execute(query).fetchall() != model.execute(query).fetchall():
            raise MapFileError("its tables are not those of a map file")


def _rows(connection: sqlite3.Connection, table: Table) -> list[Row]:
    """All rows of a table by ascending key, without their checksums, which are checked."""
    query = f"SELECT {', '.join(table.columns)} FROM {table.name} ORDER BY {', '.join(table.keys)}"
    rows, sums = [], 0
    for *values, expected in connection.execute(query):
        row = tuple(values)
        if checksum(row) != expected:
            raise MapFileError(f"the checksum of a row of {table.name}, {row[0]}, is wrong")
        sums += expected
        _check_types(table, row)
        rows.append(row)
    totals = connection.execute("SELECT rows, checksum FROM totals WHERE name = ?", [table.name])
    if totals.fetchone() != (len(rows), sums):
        raise MapFileError(f"the table {table.name} has lost rows or has others")
    return rows


def _check_types(table: Table, row: Row) -> None:
    """Sizes of the blobs against the row's count, before anything is made of them."""
    if not table.blobs:
        return
    count = row[len(table.keys)]
    for blob, value in zip(table.blobs, row[len(table.keys) + 1 :], strict=True):
        if value is None and blob.optional:
            continue
        if len(value) != count * max(1, blob.width) * np.dtype(blob.dtype).itemsize:
            raise MapFileError(f"{blob.column} of {table.name} {row[0]} has the wrong length")


def _one(connection: sqlite3.Connection, name: str) -> Row:
    rows = _rows(connection, TABLES[name])
    if len(rows) != 1:
        raise MapFileError(f"the table {name} is empty")
    return rows[0]


# ---- tables to arrays -------------------------------------------------------------------------
def _read(connection: sqlite3.Connection, *, images: bool) -> SavedMap:
    sensor, yaml = _one(connection, "settings")[1:]
    if sensor not in {member.value for member in Sensor}:
        raise MapFileError(f"it names a sensor that is not known, '{sensor}'")
    name, content_hash, comment = _one(connection, "vocabulary")[1:]
    runs = tuple(_read_runs(connection))
    contents = _read_contents(connection)
    pictures = _rows(connection, TABLES["images"]) if images else []
    return SavedMap(
        contents,
        Settings.from_yaml(yaml, Sensor(sensor)),
        VocabularyIdentity(name, content_hash, comment),
        runs,
        dict(pictures),
    )


def _read_runs(connection: sqlite3.Connection) -> Iterator[Run]:
    frames: dict[int, list[Row]] = {}
    for run, _part, *rest in _rows(connection, TABLES["frames"]):
        frames.setdefault(run, []).append((run, *rest))
    table = Table("frames", ("run",), (), TABLES["frames"].blobs)
    for number, program, started, seed, options in _rows(connection, TABLES["runs"]):
        arrays = _join(table, frames.pop(number, []))
        try:
            chosen = json.loads(options)
        except ValueError:
            chosen = None
        if not isinstance(chosen, dict):
            raise MapFileError(f"the options of run {number} are not readable")
        yield Run(program, started, seed, chosen, RecordedFrames(**arrays))
    if frames:
        raise MapFileError("there are frames of a run that is not there")


def _read_contents(connection: sqlite3.Connection) -> MapContents:
    _, next_keyframe, next_point = _one(connection, "map")
    cameras = _read_cameras(_rows(connection, TABLES["cameras"]))
    keyframes = _read_keyframes(
        _rows(connection, TABLES["keyframes"]), _rows(connection, TABLES["keypoints"])
    )
    removed = _rows(connection, TABLES["removed_keyframes"])
    poses = _poses([row[2] for row in removed])
    edges = _rows(connection, TABLES["covisibility"])
    first = np.repeat(
        np.array([row[0] for row in edges], np.int64), np.array([row[1] for row in edges], np.int64)
    )
    loops = _rows(connection, TABLES["loop_edges"])
    return MapContents(
        map_index=0,
        next_keyframe=next_keyframe,
        next_point=next_point,
        cameras=cameras,
        keyframes=keyframes,
        removed_keyframes=RemovedKeyframes(
            ids=_column(removed, 0, np.int64),
            parent=_column(removed, 1, np.int64),
            rotations=poses[:, :4].copy(),
            translations=poses[:, 4:].copy(),
            scale=_column(removed, 3, np.float64),
            parent_scale=_column(removed, 4, np.float64),
        ),
        points=Points(**_join_table(connection, "map_points")),
        observations=Observations(**_join_table(connection, "observations")),
        covisibility=Covisibility(a=first, **_join(TABLES["covisibility"], edges)),
        loop_edges=np.array(loops, np.int64).reshape(-1, 2),
    )


def _read_cameras(rows: list[Row]) -> Cameras:
    if [row[0] for row in rows] != list(range(len(rows))):
        raise MapFileError("a camera is missing")
    names = ("fx", "fy", "cx", "cy")
    return Cameras(
        **{name: _column(rows, 1 + i, np.float64) for i, name in enumerate(names)},
        distortion=np.array([row[5:10] for row in rows], np.float64).reshape(-1, 5),
        bf=_column(rows, 10, np.float64),
        depth_ratio=_column(rows, 11, np.float64),
        width=_column(rows, 12, np.int64),
        height=_column(rows, 13, np.int64),
        scale_factor=_column(rows, 14, np.float32),
        n_levels=_column(rows, 15, np.int64),
    )


def _read_keyframes(rows: list[Row], keypoints: list[Row]) -> Keyframes:
    ids = _column(rows, 0, np.int64)
    if not np.array_equal(ids, _column(keypoints, 0, np.int64)):
        raise MapFileError("keyframes and their keypoints do not belong together")
    table = TABLES["keypoints"]
    counts = _column(keypoints, 1, np.int64)
    has_colours = np.array([row[-1] is not None for row in keypoints], bool)
    if has_colours.any():
        keypoints = [
            row if row[-1] is not None else (*row[:-1], bytes(3 * row[1])) for row in keypoints
        ]
    poses = _poses([row[4] for row in rows])
    return Keyframes(
        ids=ids,
        frame_ids=_column(rows, 1, np.int64),
        timestamps=_column(rows, 2, np.float64),
        camera=_column(rows, 3, np.int64),
        rotations=poses[:, :4].copy(),
        translations=poses[:, 4:].copy(),
        scale=_column(rows, 5, np.float64),
        parent=np.array([-1 if row[6] is None else row[6] for row in rows], np.int64),
        provisional_parent=_column(rows, 7, np.int64) != 0,
        processed=_column(rows, 8, np.int64) != 0,
        has_colours=has_colours,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        **_join(table, keypoints),
    )


def _column(rows: list[Row], place: int, dtype: Any) -> NDArray[Any]:
    return np.array([row[place] for row in rows], dtype)


def _poses(blobs: list[bytes]) -> NDArray[np.float64]:
    if any(len(blob) != 7 * 8 for blob in blobs):
        raise MapFileError("a pose has the wrong length")
    return np.frombuffer(b"".join(blobs), "<f8").astype(np.float64).reshape(-1, 7)


def _join_table(connection: sqlite3.Connection, name: str) -> dict[str, NDArray[Any]]:
    return _join(TABLES[name], _rows(connection, TABLES[name]))


def _join(table: Table, rows: list[Row]) -> dict[str, NDArray[Any]]:
    """The blobs of all rows, one after the other, as arrays by field."""
    arrays = {}
    for place, blob in enumerate(table.blobs, start=len(table.keys) + 1):
        parts = [row[place] for row in rows]
        if blob.optional and any(part is None for part in parts):
            if not all(part is None for part in parts):
                raise MapFileError(f"{blob.column} is missing in some rows of {table.name}")
            parts = []
        native = np.dtype(blob.dtype).newbyteorder("=")
        array = np.frombuffer(b"".join(parts), blob.dtype).astype(native, copy=True)
        arrays[blob.field] = array.reshape(-1, blob.width) if blob.width else array
    return arrays


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
