# SPDX-License-Identifier: BSD-3-Clause
"""A line scanner for the YAML dialect of OpenCV (ORB-SLAM settings, EuRoC ``sensor.yaml``).

OpenCV's own reader hides repeated keys and turns bad numbers into 0 or 3.4e38; generic YAML
libraries refuse the first line ``%YAML:1.0`` and ``key:[1, 2]`` without a space. This scanner keeps
every value as text together with its line, so that messages can name the line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from orbslam2py._arrays import FloatArray

_KEY = re.compile(r"^(?P<key>[A-Za-z_][\w./\-]*)\s*:(?P<value>.*)$")
_ITEM = re.compile(r"^-(\s|$)")
_NUMBER = re.compile(r"^[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?$")
_NOT_FINITE = re.compile(r"^[+-]?\.?(nan|inf|infinity)$", re.IGNORECASE)


@dataclass(frozen=True)
class Problem:
    """An error of a file; `line` counts from 1, None if it is not in one line."""

    line: int | None
    text: str

    def located(self, path: object) -> str:
        """``path:line: text``, the format that editors can open."""
        return f"{path}:{self.line}: {self.text}" if self.line else f"{path}: {self.text}"


@dataclass(frozen=True)
class Entry:
    """One key with its unconverted value: a scalar's text, a list's items or nested entries."""

    key: str
    line: int
    value: str | tuple[str, ...] | Mapping[str, Entry]


@dataclass
class Document:
    """The entries of a file by key (the first of repeated ones), and its errors."""

    entries: dict[str, Entry] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)


@dataclass(frozen=True)
class _Line:
    number: int
    indent: int
    text: str


def scan(text: str) -> Document:
    """Split a file into entries.

    Parameters
    ----------
    text
        The whole file. The ``%YAML`` line is optional; ``---`` and ``...`` are skipped.

    Returns
    -------
    Document
        Keys in the order of the file. Lines that are not ``key: value``, unclosed lists and
        repeated keys are reported as problems.
    """
    document = Document()
    lines = _content_lines(text)
    document.entries, _ = _scan_block(lines, 0, 0, document.problems)
    return document


def parse_number(text: str) -> float:
    """Convert the text of a scalar.

    Raises
    ------
    ValueError
        If the text is no finite decimal number; the message is a sentence for the user.
    """
    if _NUMBER.match(text):
        value = float(text)
        if math.isfinite(value):
            return value
        raise ValueError(f"{text} is too large")
    if _NOT_FINITE.match(text):
        raise ValueError(f"{text} is not finite")
    raise ValueError(f"'{text}' is not a number" if text else "the value is empty")


def read_number(entry: Entry) -> float:
    """Return the finite number of a scalar entry.

    Raises
    ------
    ValueError
        The message is a sentence for the user that begins with the key.
    """
    if not isinstance(entry.value, str):
        raise ValueError(f"{entry.key} must be one number, not a list or a map")
    try:
        return parse_number(entry.value)
    except ValueError as error:
        raise ValueError(f"{entry.key}: {error}") from None


def read_matrix(entry: Entry) -> FloatArray:
    """Return the float64 (rows, cols) matrix of an entry with rows, cols and data.

    Raises
    ------
    ValueError
        The message is a sentence for the user.
    """
    if not isinstance(entry.value, Mapping):
        raise ValueError(f"{entry.key} must be a matrix with rows, cols and data")
    missing = [name for name in ("rows", "cols", "data") if name not in entry.value]
    if missing:
        raise ValueError(f"{entry.key} has no {' and no '.join(missing)}")
    shape = []
    for name in ("rows", "cols"):
        number = read_number(entry.value[name])
        if not number.is_integer() or not 1 <= number <= 1000:
            raise ValueError(f"{entry.key}: {name} is {number:g}; allowed: 1 to 1000")
        shape.append(int(number))
    data = entry.value["data"].value
    if not isinstance(data, tuple):
        raise ValueError(f"{entry.key}: data must be a list [...]")
    if len(data) != shape[0] * shape[1]:
        raise ValueError(
            f"{entry.key} should hold {shape[0]} x {shape[1]} = {shape[0] * shape[1]} numbers, "
            f"found {len(data)}"
        )
    try:
        return np.array([parse_number(item) for item in data], dtype=np.float64).reshape(shape)
    except ValueError as error:
        raise ValueError(f"{entry.key}: {error}") from None


def flat(document: Document) -> dict[str, Entry]:
    """Name nested entries by their path (``Camera.fx``), as in files without blocks.

    Matrices are not changed. Entries that the file has in both forms are added to the problems of
    the document.
    """
    found: dict[str, Entry] = {}
    _flatten(document.entries, "", found, document.problems)
    return found


def _flatten(
    entries: Mapping[str, Entry], above: str, found: dict[str, Entry], problems: list[Problem]
) -> None:
    for entry in entries.values():
        name = above + entry.key
        if isinstance(entry.value, Mapping) and "data" not in entry.value:
            _flatten(entry.value, f"{name}.", found, problems)
        elif name in found:
            problems.append(
                Problem(
                    entry.line,
                    f"{name} is given twice (first on line {found[name].line}); keep one",
                )
            )
        else:
            found[name] = Entry(name, entry.line, entry.value)


def _content_lines(text: str) -> list[_Line]:
    lines = []
    for number, raw in enumerate(text.lstrip("\ufeff").splitlines(), start=1):
        line = _without_comment(raw.expandtabs(8)).rstrip()
        content = line.lstrip()
        if content and not content.startswith("%YAML") and content not in ("---", "..."):
            lines.append(_Line(number, len(line) - len(content), content))
    return lines


def _without_comment(line: str) -> str:
    quote = ""
    for position, character in enumerate(line):
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'":
            quote = character
        elif character == "#" and (position == 0 or line[position - 1] in " \t],"):
            return line[:position]
    return line


def _scan_block(
    lines: list[_Line], start: int, indent: int, problems: list[Problem]
) -> tuple[dict[str, Entry], int]:
    """Read entries from `start` to the first less indented line; return them and that line."""
    entries: dict[str, Entry] = {}
    position = start
    while position < len(lines) and lines[position].indent >= indent:
        line = lines[position]
        match = _KEY.match(line.text)
        position += 1
        if match is None:
            problems.append(Problem(line.number, f"expected 'key: value', found '{line.text}'"))
            continue
        key, value = match["key"], match["value"].strip()
        if value.startswith("["):
            while "]" not in value and position < len(lines):
                if _KEY.match(lines[position].text):
                    break
                value += " " + lines[position].text
                position += 1
            entry = _list_entry(key, value, line.number, problems)
        elif value == "" or value.startswith("!!"):
            entry, position = _scan_nested(key, line, lines, position, problems)
        else:
            entry = Entry(key, line.number, _unquoted(value))
        if key in entries:
            first = entries[key].line
            problems.append(
                Problem(line.number, f"{key} is given twice (first on line {first}); keep one")
            )
        else:
            entries[key] = entry
    return entries, position


def _scan_nested(
    key: str, line: _Line, lines: list[_Line], position: int, problems: list[Problem]
) -> tuple[Entry, int]:
    items: list[str] = []
    while position < len(lines) and lines[position].indent >= line.indent:
        text = lines[position].text
        if not _ITEM.match(text) and (not items or lines[position].indent == line.indent):
            break
        items.append(_unquoted(text.removeprefix("-").strip()))
        position += 1
    if items:
        return Entry(key, line.number, tuple(items)), position
    if position < len(lines) and lines[position].indent > line.indent:
        nested, position = _scan_block(lines, position, lines[position].indent, problems)
        return Entry(key, line.number, nested), position
    return Entry(key, line.number, ""), position


def _list_entry(key: str, text: str, number: int, problems: list[Problem]) -> Entry:
    body, closed, rest = text[1:].partition("]")
    if not closed:
        problems.append(Problem(number, f"the list of {key} is not closed with ']'"))
    elif rest.strip():
        problems.append(Problem(number, f"'{rest.strip()}' after the list of {key}"))
    items = [item.strip() for item in body.split(",")]
    if items and items[-1] == "":
        items.pop()  # an empty list, or a comma after the last item
    return Entry(key, number, tuple(items))


def _unquoted(value: str) -> str:
    if len(value) >= 2 and value[0] == value[-1] and value[0] in "\"'":
        return value[1:-1]
    return value
