# SPDX-License-Identifier: BSD-3-Clause
"""Lines of the text lists in data sets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from orbslam2py._arguments import cannot_open, path_of
from orbslam2py.errors import DatasetError


@dataclass(frozen=True)
class TextLine:
    """A line with content: its number from 1 and its fields without surrounding spaces."""

    number: int
    fields: list[str]


def content_lines(path: str | Path, separator: str | None = None) -> list[TextLine]:
    """Split a text file into fields; empty lines and lines starting with ``#`` are left out.

    Parameters
    ----------
    path
        The file.
    separator
        Separator of the fields; None: spaces and tabs.

    Raises
    ------
    DatasetError
        If the file cannot be read.
    """
    path = path_of(path, "the file to read")
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    lines = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if line and not line.startswith("#"):
            fields = line.split(separator)
            lines.append(TextLine(number, [field.strip() for field in fields]))
    return lines


def numbers_of(path: str | Path, line: TextLine, counts: tuple[int, ...]) -> list[float]:
    """Convert all fields of a line to finite numbers.

    Parameters
    ----------
    path, line
        The file, for messages, and a line of it.
    counts
        Allowed numbers of fields.

    Raises
    ------
    DatasetError
        The message names file and line, if the number of fields is not in `counts` or a field is no
        number.
    """
    if len(line.fields) not in counts:
        expected = " or ".join(str(count) for count in counts)
        raise DatasetError(
            f"{path}:{line.number}: expected {expected} numbers, found {len(line.fields)} fields"
        )
    return [number_of(path, line, field) for field in line.fields]


def number_of(path: str | Path, line: TextLine, text: str) -> float:
    """Convert one field to a finite number.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    try:
        value = float(text)
    except ValueError:
        raise DatasetError(f"{path}:{line.number}: '{text}' is not a number; correct it") from None
    if not math.isfinite(value):
        raise DatasetError(
            f"{path}:{line.number}: {text} is not finite; correct it, or leave out the line"
        )
    return value
