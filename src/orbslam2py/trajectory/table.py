# SPDX-License-Identifier: BSD-3-Clause
"""Text tables of numbers of any program: any separator, comments, a header."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from orbslam2py._arguments import cannot_open, path_of
from orbslam2py._text_lines import TextLine
from orbslam2py.errors import DatasetError

_COMMENTS = ("#", "%", "//")
_FEWEST_COLUMNS = 7
_BETWEEN_NAMES = re.compile(r"\s*[,;]\s*")
_UNIT = re.compile(r"[\[(]\s*([a-zA-Z]*)[^\])]*[\])]")


@dataclass(frozen=True)
class Name:
    """A name in the header of a table: ``timestamp [ns]`` is ``timestamp`` with the unit ``ns``."""

    text: str
    unit: str


@dataclass(frozen=True)
class Head:
    """A line of names above a table.

    Attributes
    ----------
    number
        Number of the line, from 1.
    names
        One per column.
    is_comment
        Whether the line begins with ``#``, ``%`` or ``//``: it may then be prose.
    """

    number: int
    names: list[Name]
    is_comment: bool


@dataclass(frozen=True)
class TextTable:
    """Rows of a text table.

    Attributes
    ----------
    path
        The file, for messages.
    rows
        Their fields; the number may differ from row to row.
    heads
        Lines above the rows that may be names of the columns, the nearest first.
    has_commas
        Whether commas separate the fields.
    """

    path: Path
    rows: list[TextLine]
    heads: list[Head]
    has_commas: bool


def read_table(path: str | Path) -> TextTable:
    """Split a text table into rows and fields; separators are spaces, tabs, commas and semicolons.

    Lines that begin with ``#``, ``%`` or ``//`` are comments. A first line without a number is a
    header. Separators at the end of a line are ignored. A comma is a decimal sign if semicolons or
    spaces are the separators.

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
    heads: list[Head] = []
    rows: list[TextLine] = []
    split: Callable[[str], list[str]] | None = None
    has_commas = plain_head = False
    for number, raw in enumerate(text.replace('"', "").splitlines(), start=1):
        line = raw.strip()
        if not line:
            continue
        if line.startswith(_COMMENTS):
            if not rows:
                heads.insert(0, Head(number, _names(line), is_comment=True))
            continue
        if split is None:
            if not plain_head and not _has_number(line):
                heads.insert(0, Head(number, _names(line), is_comment=False))
                plain_head = True
                continue
            split, has_commas = _splitter(line)
        fields = split(line)
        while fields and not fields[-1].strip():
            fields.pop()
        rows.append(TextLine(number, fields))
    return TextTable(path, rows, heads, has_commas)


def _splitter(sample: str) -> tuple[Callable[[str], list[str]], bool]:
    """Return how to split lines like a sample, and whether commas are the separators."""
    if ";" in sample:
        if "," in sample:
            return lambda line: line.replace(",", ".").split(";"), False
        return lambda line: line.split(";"), False
    if "," not in sample:
        return str.split, False
    parts = sample.split()
    if len(parts) >= _FEWEST_COLUMNS and not any(part.endswith(",") for part in parts):
        return lambda line: line.replace(",", ".").split(), False
    if any(" " in part.strip() or "\t" in part.strip() for part in sample.split(",")):
        return re.compile(r"\s*,\s*|\s+").split, True
    return lambda line: line.split(","), True


def _has_number(line: str) -> bool:
    return any(is_number(field) for field in re.split(r"[,;\s]+", line) if field)


def is_number(text: str) -> bool:
    """Return whether Python reads a text as a number, also as one that is not finite."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _names(line: str) -> list[Name]:
    line = re.sub(r"^[#%/\s]+", "", line)
    if "," in line or ";" in line:
        texts = _BETWEEN_NAMES.split(line)
    else:
        texts = re.sub(r"\s+(?=[\[(])", "", line).split()
    names = []
    for text in texts:
        unit = _UNIT.search(text)
        names.append(Name(_UNIT.sub("", text).strip(), unit.group(1).lower() if unit else ""))
    while names and not names[-1].text:
        names.pop()
    return names
