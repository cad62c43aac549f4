# SPDX-License-Identifier: BSD-3-Clause
"""Rows of runs in a file, one JSON object a line, from which an interrupted benchmark continues."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from orbslam2py._files import atomic_write

Row = dict[str, Any]


_BEGIN = '{"key": '


def _begins_as_row(line: str) -> bool:
    return _BEGIN.startswith(line[: len(_BEGIN)])


def _is_row(line: str) -> bool:
    return line.startswith(_BEGIN) and line.endswith("}")


class Rows:
    """What was run, by names.

    Parameters
    ----------
    path
        The file; None: nothing is kept.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._rows: dict[str, Row] = {}
        if path is not None and path.is_file():
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
            # The last line of a program that was killed may be cut short.
            whole = lines if not lines or lines[-1].endswith("}") else lines[:-1]
            if not (all(map(_is_row, whole)) and all(map(_begins_as_row, lines[-1:]))):
                # Nothing may be written over it.
                raise SystemExit(f"{path} is no file of runs of this benchmark; give another one")
            self._rows = {row["key"]: row for row in map(json.loads, whole)}
            if len(whole) < len(lines):
                with atomic_write(path) as file:
                    file.writelines(f"{line}\n" for line in whole)

    def get(self, key: str, make: Callable[[], Row]) -> Row:
        """Return the row of a name; it is made and kept if it is not there."""
        if key not in self._rows:
            row = {"key": key, **make()}
            self._rows[key] = row
            if self._path is not None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                with self._path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
        return self._rows[key]


def add_rows(parser: argparse.ArgumentParser) -> None:
    """Option that names the file."""
    parser.add_argument("--rows", type=Path, help="file of all runs; runs in it are not repeated")
