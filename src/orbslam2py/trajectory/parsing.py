# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of the poses in a text table."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import TextLine, number_of
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.columns import (
    Columns,
    columns_by_content,
    columns_by_names,
    timed_columns,
)
from orbslam2py.trajectory.table import TextTable, is_number
from orbslam2py.trajectory.writers import TrajectoryFormat

_SAMPLE = 64  # rows by which columns are recognised
_LONGEST = 60  # characters of a line that a message shows
_FEWEST_COLUMNS = 7  # of a position and a quaternion: fewer are no poses at all
REMEDY = (
    "a trajectory has 8 (time, position, quaternion: TUM, EuRoC) or 12 (KITTI), or names its "
    "columns in a head such as: timestamp x y z qx qy qz qw"
)


def columns_of(table: TextTable, file_format: TrajectoryFormat) -> Columns:
    """Find the columns: by the header, by the content, or by the given format.

    Raises
    ------
    DatasetError
        The message names file and line, if there are no columns of poses.
    """
    first = table.rows[0]
    n = len(first.fields)
    if file_format is TrajectoryFormat.KITTI:
        return _columns_of_kitti(table, n)
    for head in table.heads:
        columns = columns_by_names(head, n)
        if columns is not None:
            return columns
        if not head.is_comment and len(head.names) == n >= _FEWEST_COLUMNS:
            names = " ".join(name.text for name in head.names)
            raise DatasetError(
                f"{table.path}:{head.number}: the head ({shortened(names)}) does not name a time, "
                "a position and a quaternion; name the columns timestamp x y z qx qy qz qw"
            )
    found = columns_by_content(_sample(table, n))
    if file_format is TrajectoryFormat.AUTO:
        if found is not None:
            return found
        raise no_trajectory(table)
    if n < 8:
        raise DatasetError(
            f"{table.path}:{first.number}: expected 8 numbers, found {n} fields; {REMEDY}"
        )
    return found if found is not None and found.quaternion else timed_columns(0)


def no_trajectory(table: TextTable) -> DatasetError:
    """Return a description of the first line of a file that is no trajectory."""
    head = next((head for head in table.heads if not head.is_comment), None)
    row = table.rows[0] if table.rows else None
    if head is not None and not (row and any(is_number(field) for field in row.fields)):
        number, fields, lacking = (
            head.number,
            [name.text for name in head.names],
            "no row of numbers",
        )
    else:
        assert row is not None
        few = "no" if len(row.fields) > 8 else "too few for a"
        number, fields, lacking = row.number, row.fields, f"{few} time, position and quaternion"
    return DatasetError(
        f"{table.path}:{number}: {len(fields)} fields ({shortened(' '.join(fields))}), {lacking}; "
        f"{REMEDY}"
    )


def _columns_of_kitti(table: TextTable, n: int) -> Columns:
    if n not in (12, 16):
        raise DatasetError(
            f"{table.path}:{table.rows[0].number}: expected 12 numbers, found {n} fields; a row of "
            "KITTI's format is the upper three rows of T_wc"
        )
    return Columns(None, matrix=tuple(range(12)))


def _sample(table: TextTable, n: int) -> FloatArray:
    """Return some rows, distributed over the table, (m, n); NaN for fields that are no numbers."""
    step = math.ceil(len(table.rows) / _SAMPLE)
    rows = [line.fields for line in table.rows[::step] if len(line.fields) == n]
    return np.array(
        [[float(field) if is_number(field) else math.nan for field in row] for row in rows]
    )


def numbers_in(table: TextTable, columns: Columns) -> FloatArray:
    """Convert the used columns, float64 (n, k), k as many as `Columns.used`.

    Raises
    ------
    DatasetError
        The message names file and line of a field that is no finite number, or of a line with
        another number of fields than the first.
    """
    n = len(table.rows[0].fields)
    fewest = max(columns.used) + 1
    rows = []
    for line in table.rows:
        fields = line.fields
        if len(fields) != n and (len(fields) < fewest or not columns.is_named):
            raise DatasetError(
                f"{table.path}:{line.number}: expected {n} numbers, found {len(fields)} fields; "
                "all lines must have as many; correct it, or leave out the line"
            )
        try:
            rows.append([float(fields[column]) for column in columns.used])
        except ValueError:
            _name_the_field(table, line, columns.used)
    values = np.array(rows, dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        _name_the_field(table, table.rows[int(bad[0])], columns.used)
    return values


def _name_the_field(table: TextTable, line: TextLine, used: Sequence[int]) -> None:
    for column in used:
        number_of(table.path, line, line.fields[column].strip())


def shortened(text: str) -> str:
    """Quote a line for a message: its beginning, without unprintable characters."""
    shown = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."
    return "".join(
        letter if letter.isprintable() and letter != "\ufffd" else "?" for letter in shown
    ).join("''")
