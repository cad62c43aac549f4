# SPDX-License-Identifier: BSD-3-Clause
"""Files that a command writes: only its own earlier results are replaced."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from orbslam2py.errors import OutputFileError

if TYPE_CHECKING:
    from orbslam2py.runs.report_page import PageKind

#: So much of a file is read to see whether figures could be in it [bytes]: they take a hundredth.
_MOST_FIGURES = 1 << 20


def check_target(path: Path | None, *, force: bool) -> None:
    """Raise `OutputFileError` if a file must not or cannot be written."""
    check_kept(path, force=force)
    if path is not None and not path.absolute().parent.is_dir():
        raise OutputFileError(f"{path.parent}: no such folder; make it first, or give another name")


def check_kept(*paths: Path | None, force: bool) -> None:
    """Raise `OutputFileError` if an existing file must not be replaced."""
    for path in paths:
        if path is not None and path.exists() and not force:
            raise OutputFileError(f"{path} exists; use --force to replace it")


def check_apart(outputs: Mapping[str, Path | None], inputs: Iterable[Path] = ()) -> None:
    """Check that all written files differ, and that none of them is read.

    Parameters
    ----------
    outputs
        The written files, by their options.
    inputs
        The input files.

    Raises
    ------
    OutputFileError
        The message names the options, or the file.
    """
    read = {path.resolve() for path in inputs}
    options: dict[Path, str] = {}
    for option, path in outputs.items():
        if path is None:
            continue
        place = path.resolve()
        if place in read:
            raise OutputFileError(f"{option} {path} is what is read; give another name")
        if place in options:
            raise OutputFileError(
                f"{options[place]} and {option} both write {path}; give one of them another name"
            )
        options[place] = option


def check_page(path: Path, kind: PageKind) -> Path:
    """Check that a page may be written there: only one of the same kind is replaced.

    Raises
    ------
    OutputFileError
        If another file has this name.
    """
    if path.is_dir():
        raise OutputFileError(f"{path} is a folder; give the page a name with --output")
    from orbslam2py.runs.report_page import kind_of_page  # noqa: PLC0415  (large)

    if _holds_something(path):
        there = kind_of_page(path)
        if there is not kind:
            what = "no page of this program" if there is None else f"the page of {_OF[there.value]}"
            raise OutputFileError(
                f"{path} exists and is {what}, so it is kept; give the page another name with "
                "--output"
            )
    return path


_OF = {"run": "one run", "comparison": "several runs", "benchmark": "a benchmark"}


def check_figures(path: Path | None, names: Collection[str], *, force: bool) -> None:
    """Check that figures may be written there as JSON: only the same ones are replaced.

    Raises
    ------
    OutputFileError
        If another file has this name.
    """
    if path is None or force or not _holds_something(path):
        return
    try:
        with path.open("rb") as stream:
            there = json.loads(stream.read(_MOST_FIGURES))
    except (OSError, ValueError):
        there = None
    if not isinstance(there, dict) or set(there) != set(names):
        raise OutputFileError(
            f"{path} exists and does not hold figures of this command; use --force to replace it"
        )


def _holds_something(path: Path) -> bool:
    return path.is_file() and path.stat().st_size > 0
