# SPDX-License-Identifier: BSD-3-Clause
"""Arrays from the tables of a map file; rows are checked by their checksums.

Sizes are checked before memory is allocated. Rows are read one by one, so that reading needs no
more memory than the result.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.content_groups import (
    LENS_SIZE,
    MOUNT_SIZE,
    AlignedSightings,
    Cameras,
    Covisibility,
    ImuStates,
    Keyframes,
    Observations,
    Patches,
    Points,
    RemovedKeyframes,
    model_number_of,
    no_mounts,
)
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.map_rows import Row, checksum
from orbslam2py.maps.schema import RATIONAL_LENS, RIG_MOUNT, Blob, Table

#: Keyframes whose keypoints are read at once: a few megabytes.
_PART = 64


def each_row(connection: sqlite3.Connection, table: Table) -> Iterator[Row]:
    """Yield the rows of a table by ascending key, without their checksums, which are checked.

    Raises
    ------
    MapFileError
        If a row differs from its checksum; after the last row, if rows are missing.
    """
    query = f"SELECT {', '.join(table.columns)} FROM {table.name} ORDER BY {', '.join(table.keys)}"
    n, sums = 0, 0
    for *values, expected in connection.execute(query):
        row = tuple(values)
        if checksum(row) != expected:
            raise MapFileError(f"the checksum of a row of {table.name}, {row[0]}, is wrong")
        sums += expected
        n += 1
        yield row
    totals = connection.execute("SELECT rows, checksum FROM totals WHERE name = ?", [table.name])
    if totals.fetchone() != (n, sums):
        raise MapFileError(f"the table {table.name} has lost rows or has others")


def read_rows(connection: sqlite3.Connection, table: Table) -> list[Row]:
    """All rows of a table, as `each_row` gives them."""
    return list(each_row(connection, table))


def read_one(connection: sqlite3.Connection, table: Table) -> Row:
    """Return the row of a table with one row."""
    rows = read_rows(connection, table)
    if len(rows) != 1:
        raise MapFileError(f"the table {table.name} is empty")
    return rows[0]


class BlobTable:
    """A table of arrays, split into rows; sizes are read and checked at once.

    Parameters
    ----------
    connection
        To the file.
    table
        One that has blobs.

    Attributes
    ----------
    keys : array of int64 (n, m)
        Of all rows, ascending.
    counts : array of int64 (n,)
        Items of the arrays in each row.
    """

    def __init__(self, connection: sqlite3.Connection, table: Table) -> None:
        self._connection = connection
        self._table = table
        self._sizes = [_size_of(blob) for blob in table.blobs]
        keys = ", ".join(table.keys)
        lengths = ", ".join(f"length({blob.column})" for blob in table.blobs)
        query = f"SELECT {keys}, count, {lengths} FROM {table.name} ORDER BY {keys}"
        rows = connection.execute(query).fetchall()
        n_keys = len(table.keys)
        if not all(isinstance(number, int) for row in rows for number in row[: n_keys + 1]):
            raise MapFileError(f"a row of {table.name} has a key or a count that is no number")
        self.keys: IntArray = np.array([row[:n_keys] for row in rows], np.int64)
        self.keys = self.keys.reshape(-1, n_keys)
        self.counts: IntArray = np.array([row[n_keys] for row in rows], np.int64)
        self._present: dict[str, NDArray[np.bool_]] = {}
        for blob, *sizes in zip(table.blobs, *(row[n_keys + 1 :] for row in rows), strict=True):
            self._check_sizes(blob, sizes)
            present = np.array([size is not None for size in sizes], bool)
            self._present[blob.field] = present & (present.all() or not blob.all_or_none)

    def has(self, field: str) -> NDArray[np.bool_]:
        """(n,) mask of the rows that have values of an optional array."""
        return self._present[field]

    def whole(self) -> dict[str, NDArray[Any]]:
        """All rows, concatenated, as arrays by field."""
        ((arrays, _),) = self.parts(max(1, len(self.counts)))
        return arrays

    def parts(self, rows_each: int = _PART) -> Iterator[tuple[dict[str, NDArray[Any]], int]]:
        """Arrays by field of `rows_each` rows each time, and their number; at least one part."""
        rows = each_row(self._connection, self._table)
        begin = 0
        while True:
            end = min(begin + rows_each, len(self.counts))
            last = end == len(self.counts)
            arrays = self._arrays(self.counts[begin:end].sum())
            place = 0
            # To the very end, where the totals are compared.
            for number, row in enumerate(rows if last else islice(rows, end - begin), begin):
                place += self._put(row, number, arrays, place)
            if number_of_missing := int(self.counts[begin:end].sum()) - place:
                raise MapFileError(f"{number_of_missing} rows of {self._table.name} are missing")
            yield arrays, end - begin
            if last:
                return
            begin = end

    def _check_sizes(self, blob: Blob, sizes: list[int | None]) -> None:
        item = _size_of(blob)
        for key, count, size in zip(self.keys, self.counts, sizes, strict=True):
            if size is None and blob.optional:
                continue
            if size is None or size != int(count) * item:
                raise MapFileError(
                    f"{blob.column} of {self._table.name} {key[0]} has the wrong length"
                )
        missing = sizes.count(None)
        if missing and missing != len(sizes) and not (blob.sparse or blob.all_or_none):
            raise MapFileError(f"{blob.column} is missing in some rows of {self._table.name}")

    def _arrays(self, n: int) -> dict[str, NDArray[Any]]:
        arrays = {}
        for blob in self._table.blobs:
            present = self._present[blob.field]
            rows = n if present.any() or not blob.optional else 0
            native = np.dtype(blob.dtype).newbyteorder("=")
            shape = (rows, blob.width) if blob.width else (rows,)
            # A missing sparse column means zeros.
            arrays[blob.field] = np.zeros(shape, native) if blob.sparse else np.empty(shape, native)
        return arrays

    def _put(self, row: Row, number: int, arrays: Mapping[str, NDArray[Any]], place: int) -> int:
        """Copy the blobs of a row into the arrays; return its count."""
        first = len(self._table.keys)
        count = row[first]
        if number >= len(self.counts) or count != self.counts[number]:
            raise MapFileError(f"the table {self._table.name} changed while it was read")
        blobs = zip(self._table.blobs, self._sizes, row[first + 1 :], strict=True)
        for blob, size, value in blobs:
            if value is None or not self._present[blob.field][number]:
                continue
            array = arrays[blob.field]
            if not isinstance(value, bytes) or len(value) != count * size:
                raise MapFileError(f"{blob.column} of {self._table.name} has the wrong length")
            items = np.frombuffer(value, blob.dtype)
            array[place : place + count] = items.reshape(-1, blob.width) if blob.width else items
        return int(count)


def _size_of(blob: Blob) -> int:
    """Bytes of an item."""
    return max(1, blob.width) * np.dtype(blob.dtype).itemsize


class MapTables:
    """The map in an open file; only checksums and sizes have been checked yet.

    Parameters
    ----------
    connection
        The connection, in a transaction.
    tables
        Tables of the file's version.
    """

    def __init__(self, connection: sqlite3.Connection, tables: Mapping[str, Table]) -> None:
        self._connection = connection
        self._tables = tables
        self._keypoints = BlobTable(connection, tables["keypoints"])

    @property
    def n_keypoints(self) -> int:
        """Of all keyframes."""
        return int(self._keypoints.counts.sum())

    def contents(self) -> MapContents:
        """Everything."""
        return self._contents(self._keypoints.whole())

    def without_keypoints(self) -> MapContents:
        """All but the keypoints (see `keypoint_parts`)."""
        none = {
            blob.field: np.zeros((0, blob.width) if blob.width else 0, blob.dtype)
            for blob in self._tables["keypoints"].blobs
        }
        return self._contents(none)

    def keypoint_parts(self) -> Iterator[tuple[dict[str, NDArray[Any]], int]]:
        """Keypoints of some keyframes each time, for the C++ core, and the number of keyframes."""
        for arrays, n in self._keypoints.parts():
            arrays.setdefault("words", np.zeros(0, np.uint32))
            yield {f"keyframes.{name}": array for name, array in arrays.items()}, n

    def _contents(self, keypoints: dict[str, NDArray[Any]]) -> MapContents:
        connection, tables = self._connection, self._tables
        removed = read_rows(connection, tables["removed_keyframes"])
        poses = _poses([row[2] for row in removed])
        edges = BlobTable(connection, tables["covisibility"])
        loops = read_rows(connection, tables["loop_edges"])
        next_keyframe, next_point = read_one(connection, tables["map"])[1:]
        return MapContents(
            map_index=0,
            next_keyframe=next_keyframe,
            next_point=next_point,
            cameras=_read_cameras(read_rows(connection, tables["cameras"]), tables["cameras"]),
            keyframes=self._keyframes(keypoints),
            removed_keyframes=RemovedKeyframes(
                ids=_column(removed, 0, np.int64),
                parent=_column(removed, 1, np.int64),
                rotations=poses[:, :4].copy(),
                translations=poses[:, 4:].copy(),
                scale=_column(removed, 3, np.float64),
                parent_scale=_column(removed, 4, np.float64),
            ),
            points=Points(**BlobTable(connection, tables["map_points"]).whole()),
            observations=Observations(**BlobTable(connection, tables["observations"]).whole()),
            covisibility=Covisibility(a=np.repeat(edges.keys[:, 0], edges.counts), **edges.whole()),
            loop_edges=np.array(loops, np.int64).reshape(-1, 2),
            imu_states=self._imu_states(),
            **self._alignment(),
        )

    def _alignment(self) -> dict[str, Any]:
        """Patches, and sightings that were aligned to them."""
        if "patches" not in self._tables:  # files of earlier versions
            return {}
        connection, tables = self._connection, self._tables
        sightings = BlobTable(connection, tables["aligned"])
        aligned = sightings.whole()
        aligned["reference"] = aligned["reference"] != 0
        noise = read_rows(connection, tables["alignment_noise"])
        return {
            "patches": Patches(**BlobTable(connection, tables["patches"]).whole()),
            "aligned": AlignedSightings(
                keyframe=np.repeat(sightings.keys[:, 0], sightings.counts), **aligned
            ),
            "alignment_noise": np.array([row[1:] for row in noise], np.float64).reshape(-1, 2),
        }

    def _imu_states(self) -> ImuStates:
        if "imu_states" not in self._tables:  # files of earlier versions
            return ImuStates.none()
        rows = read_rows(self._connection, self._tables["imu_states"])
        for keyframe, velocity, _, bias, count, samples in rows:
            for name, blob, n in (
                ("velocity", velocity, 3),
                ("bias", bias, 6),
                ("samples", samples, 7 * count),
            ):
                if len(blob) != 8 * n:
                    raise MapFileError(f"{name} of imu_states {keyframe} has the wrong length")
        return ImuStates(
            ids=_column(rows, 0, np.int64),
            velocity=_floats([row[1] for row in rows], 3),
            scale=_column(rows, 2, np.float64),
            bias=_floats([row[3] for row in rows], 6),
            offsets=np.concatenate([[0], np.cumsum(_column(rows, 4, np.int64))]).astype(np.int64),
            samples=_floats([row[5] for row in rows], 7),
        )

    def _keyframes(self, keypoints: dict[str, NDArray[Any]]) -> Keyframes:
        rows = read_rows(self._connection, self._tables["keyframes"])
        ids = _column(rows, 0, np.int64)
        if not np.array_equal(ids, self._keypoints.keys[:, 0]):
            raise MapFileError("keyframes and their keypoints do not belong together")
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
            has_colours=self._keypoints.has("colours"),
            offsets=np.concatenate([[0], np.cumsum(self._keypoints.counts)]).astype(np.int64),
            **keypoints,
        )


def _read_cameras(rows: list[Row], table: Table) -> Cameras:
    if [row[0] for row in rows] != list(range(len(rows))):
        raise MapFileError("a camera is missing")

    def column(name: str, dtype: Any = np.float64) -> NDArray[Any]:
        if name not in table.columns:  # of a later version
            return np.zeros(len(rows), dtype)
        return _column(rows, table.columns.index(name), dtype)

    lens = ("k1", "k2", "p1", "p2", "k3", *RATIONAL_LENS)
    return Cameras(
        **{name: column(name) for name in ("fx", "fy", "cx", "cy", "bf", "depth_ratio")},
        distortion=np.stack([column(name) for name in lens], axis=1),
        width=column("width", np.int64),
        height=column("height", np.int64),
        scale_factor=column("scale_factor", np.float32),
        n_levels=column("n_levels", np.int64),
        mount=_mounts(rows, table),
        **_lenses(rows, table),
    )


def _mounts(rows: list[Row], table: Table) -> NDArray[Any]:
    """How cameras of rigs are mounted; files of earlier versions have no rigs."""
    if RIG_MOUNT[0] not in table.columns:
        return no_mounts(len(rows))
    mounts = [row[table.columns.index(RIG_MOUNT[0])] for row in rows]
    if any(len(mount) != MOUNT_SIZE * 8 for mount in mounts):
        raise MapFileError("the mount of a camera has the wrong length")
    found = np.array([np.frombuffer(mount, "<f8") for mount in mounts], np.float64)
    return found.reshape(-1, MOUNT_SIZE)


def _lenses(rows: list[Row], table: Table) -> dict[str, NDArray[Any]]:
    """The models and parameters of fisheye lenses; zeros in files of earlier versions."""
    if "model" not in table.columns:
        return {"model": np.zeros(len(rows), np.int64), "lens": np.zeros((len(rows), LENS_SIZE))}
    names, lenses = ([row[table.columns.index(name)] for row in rows] for name in ("model", "lens"))
    numbers = [model_number_of(str(name)) for name in names]
    if any(len(lens) != LENS_SIZE * 8 for lens in lenses):
        raise MapFileError("the parameters of a camera model have the wrong length")
    lens = np.array([np.frombuffer(lens, "<f8") for lens in lenses], np.float64)
    return {"model": np.array(numbers, np.int64), "lens": lens.reshape(-1, LENS_SIZE)}


def _column(rows: list[Row], place: int, dtype: Any) -> NDArray[Any]:
    with np.errstate(over="ignore"):  # numbers that are not finite are then refused with the rest
        return np.array([row[place] for row in rows], dtype)


def _poses(blobs: list[bytes]) -> NDArray[np.float64]:
    if any(len(blob) != 7 * 8 for blob in blobs):
        raise MapFileError("a pose has the wrong length")
    return _floats(blobs, 7)


def _floats(blobs: list[bytes], width: int) -> NDArray[np.float64]:
    return np.frombuffer(b"".join(blobs), "<f8").astype(np.float64).reshape(-1, width)
