# SPDX-License-Identifier: BSD-3-Clause
"""The columns of a table of text, with checked values: errors name the line."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError


class Columns:
    """Columns by their names, all of equal length.

    Parameters
    ----------
    path
        The file, for messages.
    lines
        Line number of each value.
    columns
        Texts by the name of the column.
    """

    def __init__(self, path: Path, lines: list[int], columns: Mapping[str, list[str]]) -> None:
        self._path = path
        self._lines = lines
        self._columns = columns

    def __len__(self) -> int:
        return len(self._lines)

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def __getitem__(self, name: str) -> list[str]:
        """Texts of a column.

        Raises
        ------
        DatasetError
            If there is no such column.
        """
        if name not in self._columns:
            raise DatasetError(f"{self._path} has no column {name}; run the sequence again")
        return self._columns[name]

    def get(self, name: str, otherwise: list[str]) -> list[str]:
        """Texts of an optional column."""
        return self._columns.get(name, otherwise)

    def words(self, name: str, noun: str, known: Collection[str]) -> list[str]:
        """Texts of a column with a fixed set of words.

        Raises
        ------
        DatasetError
            The message names the line of another word.
        """
        for line, text in zip(self._lines, self[name], strict=True):
            if text not in known:
                raise self._refusal(line, f"there is no {noun} '{text}'")
        return self[name]

    def numbers(self, name: str, *, may_be_empty: bool = True) -> FloatArray:
        """Finite numbers of a column, nan if empty.

        Raises
        ------
        DatasetError
            The message names the line of the invalid value.
        """
        found = np.full(len(self), np.nan)
        for row, text in enumerate(self[name]):
            if text not in ("", "nan") or not may_be_empty:
                found[row] = self._number(row, text, name)
        return found

    def whole_numbers(self, name: str) -> IntArray:
        """Whole numbers of a column.

        Raises
        ------
        DatasetError
            The message names the line of the invalid value.
        """
        numbers = self.numbers(name, may_be_empty=False)
        broken = np.flatnonzero(numbers != np.rint(numbers))
        if len(broken):
            row = int(broken[0])
            what = f"'{self[name][row]}' in the column {name} is no whole number"
            raise self._refusal(self._lines[row], what)
        return numbers.astype(np.int64)

    def _number(self, row: int, text: str, name: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            what = f"'{text}' in the column {name} is no number"
            raise self._refusal(self._lines[row], what)
        return number

    def _refusal(self, line: int, what: str) -> DatasetError:
        return DatasetError(f"{self._path}:{line}: {what}; run the sequence again")
