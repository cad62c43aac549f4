# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a map file to arrays; rows are checked against their checksums."""

from __future__ import annotations

import sqlite3
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py.errors import MapFileError
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
from orbslam2py.maps.schema import TABLES, Table


def read_rows(connection: sqlite3.Connection, table: Table) -> list[Row]:
    """All rows of a table by ascending key, without their checksums, which are checked.

    Raises
    ------
    MapFileError
        If a row is not what was written, or one is missing.
    """
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


def read_one(connection: sqlite3.Connection, name: str) -> Row:
    """The row of a table that has one."""
    rows = read_rows(connection, TABLES[name])
    if len(rows) != 1:
        raise MapFileError(f"the table {name} is empty")
    return rows[0]


def read_contents(connection: sqlite3.Connection) -> MapContents:
    """The map, of which nothing but sizes has been checked yet."""
    _, next_keyframe, next_point = read_one(connection, "map")
    cameras = _read_cameras(read_rows(connection, TABLES["cameras"]))
    keyframes = _read_keyframes(
        read_rows(connection, TABLES["keyframes"]), read_rows(connection, TABLES["keypoints"])
    )
    removed = read_rows(connection, TABLES["removed_keyframes"])
    poses = _poses([row[2] for row in removed])
    edges = read_rows(connection, TABLES["covisibility"])
    first = np.repeat(
        np.array([row[0] for row in edges], np.int64), np.array([row[1] for row in edges], np.int64)
    )
    loops = read_rows(connection, TABLES["loop_edges"])
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
        covisibility=Covisibility(a=first, **join_blobs(TABLES["covisibility"], edges)),
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
        **join_blobs(table, keypoints),
    )


def _column(rows: list[Row], place: int, dtype: Any) -> NDArray[Any]:
    return np.array([row[place] for row in rows], dtype)


def _poses(blobs: list[bytes]) -> NDArray[np.float64]:
    if any(len(blob) != 7 * 8 for blob in blobs):
        raise MapFileError("a pose has the wrong length")
    return np.frombuffer(b"".join(blobs), "<f8").astype(np.float64).reshape(-1, 7)


def _join_table(connection: sqlite3.Connection, name: str) -> dict[str, NDArray[Any]]:
    return join_blobs(TABLES[name], read_rows(connection, TABLES[name]))


def join_blobs(table: Table, rows: list[Row]) -> dict[str, NDArray[Any]]:
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
