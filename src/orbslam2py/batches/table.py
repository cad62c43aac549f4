# SPDX-License-Identifier: BSD-3-Clause
"""The results of a batch as one table: SQLite, CSV, and Parquet if pyarrow is installed."""

from __future__ import annotations

import csv
import importlib
import importlib.util
import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arguments import is_number, is_whole
from orbslam2py._files import atomic_write, printable_name, temporary_beside
from orbslam2py.batches.work import MEASURED

#: Columns that come first, in this order.
_FIRST = ("run", "sequence", "sensor", "settings", "seed", "state", "reason", "tracked", "frames")
#: Whole numbers that a database holds; seeds may be larger.
_LEAST, _LARGEST = -(2**63), 2**63 - 1


def columns_of(rows: Iterable[dict[str, Any]]) -> list[str]:
    """Return the columns of all rows: description, figures, and measured values last."""
    names = {name for row in rows for name in row}
    measured = [name for name in sorted(names) if is_measured(name)]
    first = [name for name in _FIRST if name in names]
    swept = sorted(name for name in names if name.startswith(("option.", "sweep.")))
    known = {*measured, *first, *swept}
    return [*first[:5], *swept, *first[5:], *sorted(names - known), *measured]


def is_measured(name: str) -> bool:
    """Return whether a column has measured values, which differ between equal runs."""
    return name in MEASURED or name.startswith("milliseconds.")


def write_table(folder: Path, rows: list[dict[str, Any]]) -> list[Path]:
    """Write ``results.sqlite``, ``results.csv`` and, with pyarrow, ``results.parquet``.

    Rows are in the order of their names, not in the order in which the runs ended. Values that a
    file cannot hold become text: signed integers beyond 64 bits, and readable forms of file names
    that are no valid text.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    rows = [
        {name: _storable(value) for name, value in row.items()}
        for row in sorted(rows, key=lambda row: str(row["run"]))
    ]
    columns = columns_of(rows)
    files = [folder / "results.csv", folder / "results.sqlite"]
    with atomic_write(files[0]) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_text(row.get(name)) for name in columns] for row in rows)
    _write_database(files[1], columns, rows)
    if importlib.util.find_spec("pyarrow") is not None:
        files.append(folder / "results.parquet")
        _write_parquet(files[-1], columns, rows)
    return files


def printable(text: str) -> str:
    """Return a text that may contain file names in a form for every file and font."""
    try:
        return printable_name(text)
    except UnicodeEncodeError:  # half of a character, which is no byte of a name
        return text.encode("utf-8", "replace").decode("utf-8")


def _storable(value: Any) -> bool | int | float | str | None:
    """Convert a value to a form that all files of the table can hold."""
    if value is None or isinstance(value, bool | np.bool_):
        return None if value is None else bool(value)
    if is_whole(value):
        return int(value) if _LEAST <= value <= _LARGEST else str(value)
    return float(value) if is_number(value) else printable(str(value))


def _text(value: Any) -> Any:
    return "" if value is None else str(value).lower() if isinstance(value, bool) else value


def _write_database(path: Path, columns: list[str], rows: list[dict[str, Any]]) -> None:
    temporary = temporary_beside(path)
    try:
        database = sqlite3.connect(temporary)
        try:
            names = ", ".join(f'"{name}"' for name in columns)
            database.execute(f'CREATE TABLE results ({names}, PRIMARY KEY ("run"))')
            marks = ", ".join("?" * len(columns))
            values = ([row.get(name) for name in columns] for row in rows)
            database.executemany(f"INSERT INTO results VALUES ({marks})", values)
            database.commit()
        except sqlite3.Error as error:
            remedy = "; make room there" if "full" in str(error) else ""
            raise OSError(f"cannot write {path}: {error}{remedy}") from error
        finally:
            database.close()
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _write_parquet(path: Path, columns: list[str], rows: list[dict[str, Any]]) -> None:
    arrow = importlib.import_module("pyarrow")
    parquet = importlib.import_module("pyarrow.parquet")
    arrays = {}
    for name in columns:
        values = [row.get(name) for row in rows]
        kinds = {type(value) for value in values if value is not None}
        if kinds == {int, float}:
            values = [None if value is None else float(value) for value in values]
        elif len(kinds) > 1:
            values = [None if value is None else str(value) for value in values]
        arrays[name] = arrow.array(values)
    with atomic_write(path, binary=True) as stream:
        parquet.write_table(arrow.table(arrays), stream)
