# SPDX-License-Identifier: BSD-3-Clause
"""Boards as users name them: ``9x6``, ``charuco:11x8``, ``aprilgrid:6x6``, or Kalibr's file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from orbslam2py._arguments import cannot_open
from orbslam2py.calibration.boards import AprilGrid, CharucoBoard, Target
from orbslam2py.calibration.chessboard import Board
from orbslam2py.errors import SettingsError

_KINDS = "9x6 (inner corners), charuco:11x8 (squares), aprilgrid:6x6 (tags), or Kalibr's file"


def parse_board(
    text: str,
    square: float | None,
    *,
    marker: float | None = None,
    dictionary: str | None = None,
    spacing: float | None = None,
) -> Target:
    """Make a board from the text of a user.

    Parameters
    ----------
    text
        ``9x6`` or ``chessboard:9x6`` (inner corners), ``charuco:11x8`` (squares),
        ``aprilgrid:6x6`` (tags), or a target file of Kalibr.
    square
        Side of a square, or of a tag [m]. A file of Kalibr holds it.
    marker, dictionary
        ChArUco: side of a marker [m], and the dictionary, by default ``4X4_50``.
    spacing
        AprilGrid: gap between two tags by the side of a tag, by default 0.3.

    Raises
    ------
    SettingsError
        If the text is not understood, or something is missing or does not belong to the board.
    """
    given = {"--marker": marker, "--dictionary": dictionary, "--spacing": spacing}
    kind, colon, size = text.partition(":")
    path = Path(text)
    if path.suffix.lower() in (".yaml", ".yml") or path.is_file():
        _refuse_others(text, {"--square": square, **given}, ())
        return _board_of_kalibr(path)
    if not colon:
        kind, size = "chessboard", text
    name = {"chess": "chessboard", "checkerboard": "chessboard", "april": "aprilgrid"}.get(
        kind.lower(), kind.lower()
    )
    if name not in ("chessboard", "charuco", "aprilgrid"):
        raise SettingsError(f"there is no board '{text}'; give {_KINDS}")
    if square is None:
        side = "a tag" if name == "aprilgrid" else "a square"
        raise SettingsError(f"the board {text} needs --square: the side of {side} in metres")
    if name == "chessboard":
        _refuse_others(text, given, ())
        return Board.parse(size, square)
    columns, rows = _size(text, size)
    if name == "charuco":
        _refuse_others(text, given, ("--marker", "--dictionary"))
        if marker is None:
            raise SettingsError(
                f"the board {text} needs --marker: the side of a marker in metres, which is less "
                f"than that of a square ({square:g})"
            )
        return CharucoBoard(columns, rows, square, marker, dictionary or "4X4_50")
    _refuse_others(text, given, ("--spacing",))
    return AprilGrid(columns, rows, square, 0.3 if spacing is None else spacing)


def _refuse_others(text: str, given: dict[str, Any], allowed: tuple[str, ...]) -> None:
    for option, value in given.items():
        if value is not None and option not in allowed:
            raise SettingsError(f"{option} does not belong to the board {text}; leave it out")


def _size(text: str, size: str) -> tuple[int, int]:
    parts = size.lower().replace("×", "x").split("x")  # noqa: RUF001
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise SettingsError(f"the board '{text}' is not understood; give {_KINDS}")
    return int(parts[0]), int(parts[1])


def _board_of_kalibr(path: Path) -> Target:
    """Read Kalibr's target file: ``target_type``, and its sizes in metres."""
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8", errors="replace"))
    except OSError as error:
        raise SettingsError(f"{cannot_open(path, error, 'board')}; give {_KINDS}") from error
    except yaml.YAMLError as error:
        raise SettingsError(f"{path} is no YAML: {error}") from error
    kind = values.get("target_type") if isinstance(values, dict) else None
    if kind == "aprilgrid":
        columns, rows, tag, spacing = _numbers(
            path, values, ("tagCols", "tagRows", "tagSize", "tagSpacing")
        )
        return AprilGrid(columns, rows, tag, spacing)
    if kind == "checkerboard":
        columns, rows, down, right = _numbers(
            path, values, ("targetCols", "targetRows", "rowSpacingMeters", "colSpacingMeters")
        )
        if down != right:
            raise SettingsError(
                f"{path}: fields of {down:g} by {right:g} m are no squares; print a board of "
                "squares"
            )
        return Board(columns, rows, down)
    raise SettingsError(
        f"{path}: target_type is {kind}; give a target of Kalibr with target_type aprilgrid or "
        "checkerboard, or name the board: 9x6, charuco:11x8, aprilgrid:6x6"
    )


def _numbers(path: Path, values: dict[str, Any], names: tuple[str, ...]) -> list[Any]:
    missing = [name for name in names if not isinstance(values.get(name), int | float)]
    if missing:
        raise SettingsError(f"{path}: {', '.join(missing)} must be a number in a target of Kalibr")
    return [values[name] for name in names]
