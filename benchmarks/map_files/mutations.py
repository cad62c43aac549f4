# SPDX-License-Identifier: BSD-3-Clause
"""Spoilt map files: each is loaded as it was, or refused with a sentence; nothing else happens.

    python -m benchmarks.map_files.mutations --runs 20000

Bits, bytes and blocks of the file are changed, swapped, cut or repeated, and its numbers and blobs
edited by SQL with checksums that fit again. Each file is read as a copy in memory and as a system
reads it. `make fuzz-maps` does it with an extension that was built with sanitizers.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import resource
import sqlite3
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from benchmarks.map_files.mapping import mapped
from orbslam2py import MapFileError, load_vocabulary
from orbslam2py import _core as core
from orbslam2py.maps import MapFile, load_map, save_map, take_contents
from orbslam2py.maps.map_rows import checksum
from orbslam2py.maps.schema import TABLES

#: Seconds after which a load counts as a hang.
LONGEST = 20.0


def bits(content: bytearray, draws: random.Random) -> None:
    for _ in range(draws.choice((1, 1, 1, 4, 64))):
        content[draws.randrange(len(content))] ^= 1 << draws.randrange(8)


def header(content: bytearray, draws: random.Random) -> None:
    content[draws.randrange(100)] = draws.randrange(256)


def some_bytes(content: bytearray, draws: random.Random) -> None:
    place, n = draws.randrange(len(content)), draws.choice((1, 2, 4, 8, 100))
    content[place : place + n] = draws.randbytes(len(content[place : place + n]))


def blocks(content: bytearray, draws: random.Random) -> None:
    page = 4096
    a, b = (page * draws.randrange(len(content) // page) for _ in range(2))
    content[a : a + page], content[b : b + page] = content[b : b + page], content[a : a + page]


def zeros(content: bytearray, draws: random.Random) -> None:
    place, n = draws.randrange(len(content)), draws.choice((16, 512, 4096, 65536))
    content[place : place + n] = bytes(len(content[place : place + n]))


def cut(content: bytearray, draws: random.Random) -> None:
    del content[draws.randrange(len(content)) :]


def repeated(content: bytearray, draws: random.Random) -> None:
    content.extend(content[: draws.randrange(len(content))])


NUMBERS = ("-1", "0", "1", "2147483647", "1 << 40", "9223372036854775807", "-9223372036854775808")
REALS = ("0.0", "-1.0", "1e300", "1e-300", "9e999", "-9e999")


def edited(path: Path, draws: random.Random) -> None:
    """Change a cell by SQL; checksums are made to fit."""
    table = TABLES[draws.choice([name for name in TABLES if name != "images"])]
    with closing(sqlite3.connect(path)) as connection, connection:
        rows = connection.execute(f"SELECT * FROM {table.name}").fetchall()
        if rows:
            row = list(draws.choice(rows))
            place = draws.randrange(len(table.columns) - 1)
            _edit_cell(connection, table.name, table.columns, row, place, draws)
        _fit_checksums(connection, table.name)


def _edit_cell(
    connection: sqlite3.Connection,
    table: str,
    columns: tuple[str, ...],
    row: list[object],
    place: int,
    draws: random.Random,
) -> None:
    column, value = columns[place], row[place]
    where = f"WHERE {columns[0]} = ?"
    if isinstance(value, bytes):
        spoilt = bytearray(value)
        kind = draws.randrange(4)
        if kind == 0:
            del spoilt[draws.randrange(len(spoilt) + 1) :]
        elif kind == 1 and spoilt:
            start = draws.randrange(len(spoilt))
            spoilt[start : start + 8] = draws.choice(
                (bytes(8), b"\xff" * 8, bytes(6) + b"\xf0\x7f", draws.randbytes(8))
            )
        elif kind == 2:
            spoilt = bytearray(draws.randbytes(len(spoilt)))
        else:
            others = [cell for cell in row if isinstance(cell, bytes)]
            spoilt = bytearray(draws.choice(others))
        sql, arguments = f"UPDATE {table} SET {column} = ? {where}", (bytes(spoilt), row[0])
    elif isinstance(value, str):
        text = draws.choice(("", "x" * 1000, value[: len(value) // 2], value + "\n: [", "\x00"))
        sql, arguments = f"UPDATE {table} SET {column} = ? {where}", (text, row[0])
    elif draws.randrange(5) == 0:
        sql, arguments = f"DELETE FROM {table} {where}", (row[0],)
    else:
        number = draws.choice(REALS if isinstance(value, float) else NUMBERS)
        sql, arguments = f"UPDATE {table} SET {column} = {number} {where}", (row[0],)
    with contextlib.suppress(sqlite3.Error):  # the table itself may refuse it
        connection.execute(sql, arguments)


def _fit_checksums(connection: sqlite3.Connection, name: str) -> None:
    table = TABLES[name]
    where = " AND ".join(f"{key} = ?" for key in table.keys)
    columns = ", ".join(table.columns[:-1])
    rows = connection.execute(f"SELECT {columns} FROM {name}").fetchall()
    sums = [checksum(row) for row in rows]
    for row, crc in zip(rows, sums, strict=True):
        key = row[: len(table.keys)]
        connection.execute(f"UPDATE {name} SET checksum = ? WHERE {where}", (crc, *key))
    connection.execute(
        "UPDATE totals SET rows = ?, checksum = ? WHERE name = ?", (len(rows), sum(sums), name)
    )


BYTEWISE: tuple[Callable[[bytearray, random.Random], None], ...] = (
    *(bits, header, some_bytes, blocks, zeros, cut, repeated),
)


def check(path: Path, vocabulary: core.Vocabulary) -> str:
    """Load a spoilt file as a system would: the outcome."""
    try:
        contents = load_map(path, images=True).contents
        restored = core.Map()
        MapFile(path).restore(restored, vocabulary, core.KeyFrameIndex())
    except MapFileError as error:
        assert path.name in str(error), error
        assert "\n" not in str(error), error
        return "refused"
    assert contents.first_difference(take_contents(restored)) is None
    violations = core.check_invariants(restored, require_words=True)
    assert not violations, violations[0]
    return "loaded"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first run")
    arguments = parser.parse_args()
    bad = 0
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        path, original = Path(name) / "spoilt.orbmap", Path(name) / "map.orbmap"
        save_map(mapped(20), original)
        content = original.read_bytes()
        vocabulary = load_vocabulary()
        check(original, vocabulary)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        runs = range(arguments.first, arguments.first + arguments.runs)
        for run in runs:
            draws = random.Random(arguments.seed * 1_000_003 + run)
            spoilt = bytearray(content)
            spoil = draws.choice((*BYTEWISE, edited))
            if spoil is not edited:
                spoil(spoilt, draws)
            path.write_bytes(spoilt)
            if spoil is edited:
                edited(path, draws)
            begin = time.perf_counter()
            try:
                what = check(path, vocabulary)
                seconds = time.perf_counter() - begin
                if seconds > LONGEST:
                    raise TimeoutError(f"it took {seconds:.0f} s")
            except Exception as error:
                bad += 1
                what = "failed"
                print(f"run {run}, {spoil.__name__}: {type(error).__name__}: {error}", flush=True)
            counts[f"{spoil.__name__} {what}"] += 1
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    for kind, count in sorted(counts.items()):
        print(f"{kind:24} {count}")
    print(f"{len(runs)} files, {bad} bad; memory grew by {grown:.1f} MB ({len(content) / 1e6:.1f})")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
