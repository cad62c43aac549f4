# SPDX-License-Identifier: BSD-3-Clause
"""The table at the end of a batch: a row for all seeds of a run, a column per difference."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from rich.cells import cell_len
from rich.console import JustifyMethod
from rich.table import Table
from rich.text import Text

from orbslam2py._arguments import is_number, number_of
from orbslam2py.batches import BatchResult, Spread
from orbslam2py.batches.summary import Group
from orbslam2py.batches.table import printable

#: Lines and blanks of the table: at its left, and for each column.
_AT_LEFT, _FOR_EACH = 1, 3
_SWEPT = ("option.", "sweep.")


@dataclass(frozen=True)
class _Column:
    """A heading, and a text for each row."""

    title: str
    cells: Sequence[str]
    is_number: bool = False

    @property
    def width(self) -> int:
        lines = [line for text in (self.title, *self.cells) for line in text.splitlines()]
        return max(map(cell_len, lines), default=0)


def printed_table(done: BatchResult, width: int) -> Table:
    """Make the table of a batch; the columns that distinguish the rows are visible at any width.

    Values that are equal in all rows are left out; the files contain them. If there is not enough
    room, all differences share one column.

    Parameters
    ----------
    done
        The batch.
    width
        Width of the terminal, in characters.
    """
    groups = done.groups
    first = {str(row["setting"]): row for row in reversed(done.rows)}
    rows = [first[group.setting] for group in groups]  # one for each
    differing = _differing(rows)
    title = f"{number_of(len(done.rows), 'run')}, {done.n_failed} failed"
    if rows and all(column.title != "sequence" for column in differing):
        title = f"{rows[0]['sequence']}: {title}"
    if len(set(_rows_of(differing))) < len(rows):  # as of other topics, or files of one name
        differing = [_Column("run", [group.setting for group in groups])]
    for break_ranges in (False, True):
        columns = [*differing, *_figures(groups, break_ranges=break_ranges)]
        if _AT_LEFT + sum(column.width + _FOR_EACH for column in columns) <= width:
            return _table(title, columns)
    return _table(title, [_together(differing), *columns[len(differing) :]], show_lines=True)


def _table(title: str, columns: Sequence[_Column], *, show_lines: bool = False) -> Table:
    # Texts, since names, and units, may hold what rich takes for markup.
    table = Table(title=Text(_text(title)), show_lines=show_lines)
    for column in columns:
        justify: JustifyMethod = "right" if column.is_number else "left"
        table.add_column(Text(column.title), justify=justify, overflow="fold")
    for row in _rows_of(columns):
        table.add_row(*map(Text, row))
    return table


def _rows_of(columns: Sequence[_Column]) -> list[tuple[str, ...]]:
    return list(zip(*(column.cells for column in columns), strict=True))


# ---- what runs are of ----------------------------------------------------------------------------
def _differing(rows: Sequence[dict[str, Any]]) -> list[_Column]:
    """Return the columns that distinguish rows; the sequence if none does."""
    names = {name: None for row in rows for name in row if name.startswith(_SWEPT)}
    found = []
    for name in ("sensor", "settings", *names):
        values = [row.get(name) for row in rows]
        # A run that failed early does not know its sensor, which is no difference.
        compared = [one for one in values if one is not None] if name == "sensor" else values
        if len(set(map(str, compared))) > 1:
            found.append(_column_of(name, values))
    sequences = [_text(row["sequence"]) for row in rows]
    if len(set(sequences)) > 1 or not found:
        found.insert(0, _Column("sequence", sequences))
    return found


def _column_of(name: str, values: Sequence[Any]) -> _Column:
    title = name.rpartition(".")[2]  # of a key of the settings, what it is called in its group
    if name == "settings":
        return _Column(title, [_text(PurePath(str(one or "")).stem) for one in values])
    numbers = all(one is None or is_number(one) for one in values)
    return _Column(title, [_text(one) for one in values], is_number=numbers)


def _text(value: Any) -> str:
    """Write a value so that a terminal interprets all of it as text."""
    if value is None or isinstance(value, bool):
        return "" if value is None else str(value).lower()
    return "".join(one if one.isprintable() else "\ufffd" for one in printable(str(value)))


def _together(columns: Sequence[_Column]) -> _Column:
    """Join several columns, each value with its name except the sequence."""
    if len(columns) == 1:
        return columns[0]
    titles = [column.title for column in columns]
    cells = [
        "\n".join(
            value if title == "sequence" else f"{title}={value}"
            for title, value in zip(titles, row, strict=True)
            if value
        )
        for row in _rows_of(columns)
    ]
    return _Column("run", cells)


# ---- what came of them ---------------------------------------------------------------------------
def _figures(groups: Sequence[Group], *, break_ranges: bool) -> list[_Column]:
    """Return the columns of figures; without the number of runs if it is always one."""
    counts: list[tuple[str, Iterable[int]]] = []
    if any(group.n_runs > 1 for group in groups):
        counts.append(("runs", (group.n_runs for group in groups)))
    if any(group.n_failed for group in groups):
        counts.append(("failed", (group.n_failed for group in groups)))
    columns = [
        _Column(title, [str(count) if count else "" for count in those], is_number=True)
        for title, those in counts
    ]
    figures = (
        ("ATE\n[m]", [group.ate_rmse_m for group in groups], 4, 1.0),
        ("tracked\n[%]", [group.tracked_fraction for group in groups], 1, 100.0),
        ("frames/s", [group.frames_per_second for group in groups], 1, 1.0),
        ("memory\n[MB]", [group.peak_memory_mb for group in groups], 0, 1.0),
    )
    between = "\n" if break_ranges else " "
    for title, spreads, digits, factor in figures:
        texts = [_spread(spread, digits, factor, between) for spread in spreads]
        columns.append(_Column(title, texts, is_number=True))
    return columns


def _spread(spread: Spread | None, digits: int, factor: float, between: str) -> str:
    """Return the median, followed by the range if there is one."""
    if spread is None:
        return ""
    median, least, most = (factor * x for x in (spread.median, spread.least, spread.most))
    text = f"{median:.{digits}f}"
    return text if least == most else f"{text}{between}({least:.{digits}f}-{most:.{digits}f})"
