# SPDX-License-Identifier: BSD-3-Clause
"""Small maps made once per test run, and map files to spoil."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from functools import lru_cache
from pathlib import Path

from orbslam2py import Sensor, load_vocabulary
from orbslam2py.maps import SavedMap, load_map, save_map
from orbslam2py.maps.map_rows import all_rows, checksum
from orbslam2py.maps.schema import TABLES, create_script, tables_of
from support import small_sequences

#: Frames of the mapping run: enough for several keyframes and a culled one.
FRAMES = 40


@lru_cache
def small_map(sensor: Sensor = Sensor.RGBD, frames: int = FRAMES) -> SavedMap:
    """The map of a short deterministic run, as it comes back from a file."""
    with small_sequences.new_system(sensor, deterministic=True, keyframe_images=True) as slam:
        small_sequences.play(slam, frames)
        return slam.saved_map()


def written(folder: Path, sensor: Sensor = Sensor.RGBD) -> Path:
    """A file of the small map."""
    path = folder / "small.orbmap"
    save_map(small_map(sensor), path)
    return path


def written_as_version(version: int, folder: Path) -> Path:
    """The small map as an earlier version of the format had it.

    Version 5 had neither states of an IMU nor patches, version 4 no rigs, version 3 no fisheye
    lenses, version 2 no rational ones; version 1 had no words, and a short hash of the vocabulary.
    """
    path = folder / f"version_{version}.orbmap"
    sums: dict[str, list[int]] = {name: [] for name in tables_of(version)}
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(create_script(version))
        for name, present in all_rows(small_map()):
            if name not in sums:
                continue
            row = present[:-1] if name == "keypoints" and version < 2 else present
            if name == "cameras" and version < 5:
                without = present[: -1 if version == 4 else -3]
                row = without if version >= 3 else (*without[:10], *without[13:])
            if name == "vocabulary" and version < 2:
                row = (1, "", f"{load_vocabulary().hash:016x}", "")
            sums[name].append(checksum(row))
            marks = ", ".join("?" * (len(row) + 1))
            connection.execute(f"INSERT INTO {name} VALUES ({marks})", (*row, sums[name][-1]))
        totals = [(name, len(crcs), sum(crcs)) for name, crcs in sums.items()]
        connection.executemany("INSERT INTO totals VALUES (?, ?, ?)", totals)
    return path


def edit(path: Path, *statements: str) -> Path:
    """Change a map file by SQL, as another program might; checksums are made to fit again."""
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement)
        for table in TABLES.values():
            columns = ", ".join(table.columns[:-1])
            where = " AND ".join(f"{key} = ?" for key in table.keys)
            total = 0
            rows = connection.execute(f"SELECT {columns} FROM {table.name}").fetchall()
            for row in rows:
                crc = checksum(row)
                total += crc
                connection.execute(
                    f"UPDATE {table.name} SET checksum = ? WHERE {where}",
                    (crc, *row[: len(table.keys)]),
                )
            connection.execute(
                "UPDATE totals SET rows = ?, checksum = ? WHERE name = ?",
                (len(rows), total, table.name),
            )
    return path


def same_file_content(a: Path, b: Path) -> bool:
    """Whether two map files hold equal maps."""
    return load_map(a).contents.first_difference(load_map(b).contents) is None
