# SPDX-License-Identifier: BSD-3-Clause
"""The columns of a text table with time, position and rotation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from orbslam2py._arguments import are_poses, member_of
from orbslam2py._arrays import FloatArray
from orbslam2py.trajectory.table import Head, Name
from orbslam2py.trajectory.time_units import TimeUnit

_UNIT_LENGTH = 0.01  # by which the length of a quaternion may differ from 1
_TIMES = ("timestamp", "stamp", "time", "times", "ts", "sec", "secs", "seconds", "t")
_TIME_UNITS = {"nsec": "ns", "nsecs": "ns", "nanoseconds": "ns", "usec": "us", "msec": "ms"}
_ROTATION = {"q", "quat", "quaternion", "orientation", "rotation", "rot", "ori"}
_POSITION = {"p", "pos", "position", "t", "trans", "translation"}
#: Names that stand for several columns, as in ``# timestamp(s) q p v bg ba``.
_VECTORS = {"q": "xyzw", "p": "xyz", "v": "xyz", "bg": "xyz", "ba": "xyz"}


class QuaternionOrder(str, Enum):
    """Order of the four numbers of a quaternion in a file."""

    XYZW = "xyzw"
    """The real part w last, as in TUM's files."""
    WXYZ = "wxyz"
    """The real part w first, as in EuRoC's files."""

    @classmethod
    def of(cls, value: QuaternionOrder | str) -> QuaternionOrder:
        """Take an order or its name.

        Raises
        ------
        DatasetError
            For an unknown name; the message lists the names.
        """
        return member_of(cls, value, "the order of the quaternions")

    @property
    def other(self) -> QuaternionOrder:
        """Return the other order."""
        return QuaternionOrder.WXYZ if self is QuaternionOrder.XYZW else QuaternionOrder.XYZW

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Columns:
    """The columns of poses in a table, counted from 0.

    Attributes
    ----------
    time
        Column of the time; None if there is none.
    matrix
        Columns of the upper three rows of a pose, row by row; empty for poses with quaternions.
    position
        Columns of x, y and z; empty for matrices.
    quaternion
        Columns of x, y, z and w if a header names them; otherwise the four columns in their order,
        whose meaning is not known.
    order
        Order in the file by its header; None if unknown.
    unit
        Unit of time in the header; None if it has none.
    is_named
        Whether a header names the columns.
    """

    time: int | None
    matrix: tuple[int, ...] = ()
    position: tuple[int, ...] = ()
    quaternion: tuple[int, ...] = ()
    order: QuaternionOrder | None = None
    unit: TimeUnit | None = None
    is_named: bool = False

    @property
    def used(self) -> tuple[int, ...]:
        """All used columns: the time first, if there is one."""
        time = () if self.time is None else (self.time,)
        return (*time, *self.matrix, *self.position, *self.quaternion)


def columns_by_names(head: Head, n: int) -> Columns | None:
    """Find the columns by their names.

    Parameters
    ----------
    head
        The line with the names.
    n
        Number of columns of the table.

    Returns
    -------
    Columns or None
        None if time, position and quaternion are not all named.
    """
    found: dict[str, int] = {}
    units: dict[str, TimeUnit | None] = {}
    names = _expanded(head.names)
    for number, name in enumerate(names):
        role = _role(name.text)
        if role and role not in found:
            found[role] = number
            units[role] = _time_unit(name)
    time = min((role for role in found if role.startswith("time")), default=None)
    roles = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    if time is None or any(role not in found for role in roles):
        return None
    position = tuple(found[role] for role in roles[:3])
    quaternion = tuple(found[role] for role in roles[3:])
    if max(found[time], *position, *quaternion) >= n:
        return None
    is_vector = "q" in [name.text.lower() for name in head.names]
    first = QuaternionOrder.WXYZ if found["qw"] < found["qx"] else QuaternionOrder.XYZW
    return Columns(
        found[time],
        position=position,
        quaternion=quaternion,
        order=None if is_vector else first,
        unit=units[time],
        is_named=True,
    )


def columns_by_content(sample: FloatArray) -> Columns | None:
    """Find the columns of a table without a header.

    Parameters
    ----------
    sample
        Some of its rows, float64 (m, n), m > 0; NaN for fields that are no numbers.

    Returns
    -------
    Columns or None
        Poses as 12 or 16 numbers, alone or after a time; or a time, a position and a quaternion,
        alone or after a number. None if nothing fits.
    """
    n = sample.shape[1]
    for start in (0, 1):
        if n - start in (12, 16) and _are_matrices(sample[:, start:]):
            return Columns(0 if start else None, matrix=tuple(range(start, start + 12)))
    # The first numbers of rotations are not above 1 and do not grow all the time: times do.
    grows = len(sample) > 1 and sample[-1, 0] > 1.01 and bool((np.diff(sample[:, 0]) > 0).all())
    if n == 12 and not (grows and _are_unit(sample[:, 4:8])):
        return Columns(None, matrix=tuple(range(12)))
    if n == 8 or (n > 8 and _are_unit(sample[:, 4:8])):
        return timed_columns(0)
    if n > 8 and _are_unit(sample[:, 5:9]) and np.isfinite(sample[:, :2]).all():
        time = max((0, 1), key=lambda column: _looks_like_time(sample[:, column]))
        return timed_columns(time, position=2)
    return None


def timed_columns(time: int, position: int = 1) -> Columns:
    """Return the columns of a time, a position and a quaternion behind it."""
    return Columns(
        time,
        position=tuple(range(position, position + 3)),
        quaternion=tuple(range(position + 3, position + 7)),
    )


def _are_unit(quaternions: FloatArray) -> bool:
    lengths = np.linalg.norm(quaternions, axis=1)
    return bool((np.abs(lengths - 1) < _UNIT_LENGTH).all())


def _are_matrices(rows: FloatArray) -> bool:
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    n_rows = rows.shape[1] // 4
    T[:, :n_rows] = rows.reshape(len(rows), n_rows, 4)
    return bool(are_poses(T).all())


def _looks_like_time(values: FloatArray) -> tuple[bool, bool, float]:
    steps = np.diff(values)
    return bool((steps > 0).all()), bool((values % 1 != 0).any()), float(np.abs(values).max())


def _expanded(names: Sequence[Name]) -> list[Name]:
    expanded: list[Name] = []
    for name in names:
        letters = _VECTORS.get(name.text.lower())
        expanded += [Name(name.text + letter, "") for letter in letters] if letters else [name]
    return expanded


def _role(name: str) -> str | None:
    """Return the part of a pose with this name; of several times the first by order is used."""
    text = name.lower().removesuffix("_s").removesuffix("_sec")
    tokens = [token for token in re.split(r"[^a-z0-9]+", text) if token]
    if not tokens:
        return None
    last = tokens[-1]
    compact = re.fullmatch(r"(q|quat|p|t)([xyzw])", last)
    kinds = set(tokens[:-1]) | ({compact.group(1)} if compact else set())
    component = compact.group(2) if compact else last
    if component in ("x", "y", "z", "w") and kinds & _ROTATION:
        return f"q{component}"
    if component in ("x", "y", "z") and (kinds & _POSITION or len(tokens) == 1):
        return component
    base = [token for token in tokens if token not in ("ns", "us", "ms", "header", "field")]
    if base and base[-1] in _TIMES:
        return f"time{_TIMES.index(base[-1]):02d}"
    if last == "w" and len(tokens) == 1:
        return "qw"
    return "time05" if last in _TIME_UNITS and len(tokens) == 1 else None


def _time_unit(name: Name) -> TimeUnit | None:
    """Return the unit in a time's name, except s: ``timestamp(s)`` may mean several."""
    tokens = re.split(r"[^a-z0-9]+", name.text.lower())
    for text in (name.unit, tokens[-1]):
        unit = _TIME_UNITS.get(text, text)
        if unit in ("ns", "us", "ms"):
            return TimeUnit(unit)
    return None
