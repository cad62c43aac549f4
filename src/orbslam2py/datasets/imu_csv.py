# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU in a table: EuRoC's ``imu0/data.csv``, recordings of phones."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TypeVar

import numpy as np

from orbslam2py._arguments import cannot_open
from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines
from orbslam2py.datasets.imu import ImuSamples, make_samples
from orbslam2py.errors import DatasetError

_G = 9.80665  # m/s^2, standard gravity


class GyroUnit(str, Enum):
    """Unit of the readings of a gyro."""

    RADIANS = "rad/s"
    DEGREES = "deg/s"

    @property
    def factor(self) -> float:
        """To rad/s."""
        return 1.0 if self is GyroUnit.RADIANS else float(np.pi / 180)

    def __str__(self) -> str:
        return self.value


class AccelUnit(str, Enum):
    """Unit of the readings of an accelerometer."""

    METRES = "m/s^2"
    GRAVITIES = "g"

    @property
    def factor(self) -> float:
        """To m/s^2."""
        return 1.0 if self is AccelUnit.METRES else _G

    def __str__(self) -> str:
        return self.value


#: Names of columns, without signs and units; the letter of the axis is last, or stands before or
#: after an underscore.
_TIME = re.compile(r"(time)?_?(stamp)?s?|t|time_?stamps?|seconds?(_?elapsed)?", re.IGNORECASE)
_GYRO = re.compile(
    r"w_rs_s|gyro(scope)?|gyr|g|w|omega|angular_?velocity|rotation_?rate|ang_?vel", re.IGNORECASE
)
_ACCEL = re.compile(
    r"a_rs_s|acc(el(eration|erometer)?)?|a|linear_?acceleration|lin_?acc", re.IGNORECASE
)
_AXIS = re.compile(r"(?P<name>.*?)[_.\s]*(?P<axis>[xyz])", re.IGNORECASE)
_UNIT = re.compile(r"[\[(](?P<unit>[^\])]*)[\])]")
_DEGREES = re.compile(r"deg|\u00b0|dps", re.IGNORECASE)
_GRAVITIES = re.compile(r"\s*g(rav\w*)?\s*'?s?\s*", re.IGNORECASE)

#: Steps between samples in seconds, from which the unit of the times is guessed.
_LONGEST_STEP, _SHORTEST_STEP = 0.11, 1e-4
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


_Unit = TypeVar("_Unit", GyroUnit, AccelUnit)


@dataclass(frozen=True)
class _Columns:
    """Columns of time, gyro and accelerometer, and the units in the header."""

    places: tuple[int, ...]
    gyro: GyroUnit | None = None
    accel: AccelUnit | None = None


@dataclass(frozen=True)
class Table:
    """A table of numbers with its header.

    Attributes
    ----------
    path
        The file.
    header
        The line that names the columns; empty if there is none.
    lines
        Numbers and texts of the other lines.
    """

    path: Path
    header: str
    lines: list[tuple[int, str]]

    @property
    def fields(self) -> list[str]:
        """Names of the columns."""
        return _fields(self.header, header=True)

    def numbers(self, places: tuple[int, ...]) -> FloatArray:
        """Take columns, (n, k).

        Raises
        ------
        DatasetError
            Naming the line that has no numbers there.
        """
        data = np.empty((len(self.lines), len(places)))
        for row, (number, line) in enumerate(self.lines):
            fields = _fields(line)
            try:
                data[row] = [float(fields[place].strip('"') or "nan") for place in places]
            except (IndexError, ValueError):
                count = {4: "three", 7: "six"}.get(len(places), str(len(places) - 1))
                raise DatasetError(
                    f"{self.path}:{number}: '{line[:80]}' is no sample of the IMU: it needs a time "
                    f"and {count} numbers; correct the line or take it away"
                ) from None
        return data


def read_table(path: Path, columns: int = 7) -> Table:
    """Read a table of samples; a line that names at least this number of columns is its header.

    Raises
    ------
    DatasetError
        If the file cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    content = [(number, line) for number, line in lines if line.strip("\ufeff#,; \t")]
    header = ""
    while content and not _is_number(_fields(content[0][1])[0]):
        # Of several lines of comment the last with enough columns names them.
        named = content.pop(0)[1].lstrip("\ufeff# \t")
        header = named if len(_fields(named, header=True)) >= columns else header
    return Table(path, header, content)


def unit_in(header: str, kind: type[_Unit]) -> _Unit | None:
    """Return the unit in brackets of a header, if it is not the usual one."""
    units = [match["unit"] for match in _UNIT.finditer(header)]
    if kind is GyroUnit and any(_DEGREES.search(unit) for unit in units):
        return kind("deg/s")
    if kind is AccelUnit and any(_GRAVITIES.fullmatch(unit) for unit in units):
        return kind("g")
    return None


def read_imu_csv(
    path: str | Path,
    *,
    gyro_unit: GyroUnit | str | None = None,
    accel_unit: AccelUnit | str | None = None,
) -> ImuSamples:
    """Read a table with the time, three columns of the gyro and three of the accelerometer.

    Parameters
    ----------
    path
        Values separated by commas, semicolons or blanks. A header names the columns, such as
        ``timestamp,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z``, with units in brackets if they
        are not rad/s and m/s^2: ``gyro_x [deg/s]``, ``accel_x [g]``. Without a header the columns
        stand in this order. Times may be in s, ms, us or ns; the unit follows from their step.
    gyro_unit, accel_unit
        Units of the readings; by default those of the header, else rad/s and m/s^2.

    Raises
    ------
    DatasetError
        Naming the file, the line and the fault.
    """
    path = Path(path)
    table = read_table(path)
    columns = _columns_of(path, table.header) if table.header else _Columns(tuple(range(7)))
    data = table.numbers(columns.places)
    data[:, 0] *= time_unit(path, data[:, 0])
    data[:, 1:4] *= GyroUnit(gyro_unit or columns.gyro or GyroUnit.RADIANS).factor
    data[:, 4:] *= AccelUnit(accel_unit or columns.accel or AccelUnit.METRES).factor
    return make_samples(str(path), data)


def read_stream(path: Path) -> FloatArray:
    """Read a list of times [s] and three readings of one sensor, float64 (n, 4).

    Raises
    ------
    DatasetError
        Naming the file and the line.
    """
    rows = []
    for line in content_lines(path):
        try:
            rows.append([float(field) for field in line.fields[:4]])
            if len(rows[-1]) < 4:
                raise ValueError
        except ValueError:
            raise DatasetError(
                f"{path}:{line.number}: this is no sample of an IMU; give a time and three numbers"
            ) from None
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _fields(line: str, *, header: bool = False) -> list[str]:
    for separator in (",", ";", "\t"):
        if separator in line:
            return [field.strip() for field in line.split(separator)]
    # Units in a header have blanks of their own.
    return _UNIT.sub("", line).split() if header else line.split()


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _columns_of(path: Path, header: str) -> _Columns:
    time: int | None = None
    found: dict[tuple[str, str], int] = {}
    units: dict[str, str] = {}
    for place, field in enumerate(_fields(header, header=True)):
        name = _UNIT.sub("", field).strip().strip('"').strip()
        match = _AXIS.fullmatch(name)
        for kind, pattern in (("gyro", _GYRO), ("accel", _ACCEL)):
            if match and pattern.fullmatch(match["name"]):
                found.setdefault((kind, match["axis"].lower()), place)
                unit = _UNIT.search(field)
                if unit:
                    units.setdefault(kind, unit["unit"])
        if time is None and name and _TIME.fullmatch(name):
            time = place
    wanted = [(kind, axis) for kind in ("gyro", "accel") for axis in "xyz"]
    missing = ["_".join(key) for key in wanted if key not in found]
    if time is None:
        missing.insert(0, "timestamp")
    if missing or time is None:
        raise DatasetError(
            f"{path}: the header names no column {', '.join(missing)}; name the columns timestamp, "
            "gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z"
        )
    return _Columns(
        (time, *(found[key] for key in wanted)),
        GyroUnit.DEGREES if _DEGREES.search(units.get("gyro", "")) else None,
        AccelUnit.GRAVITIES if _GRAVITIES.fullmatch(units.get("accel", "")) else None,
    )


def time_unit(path: Path, times: FloatArray) -> float:
    """Seconds per unit of the times, by the usual step between them."""
    steps = np.abs(np.diff(times[np.isfinite(times)]))
    steps = steps[steps > 0]
    if not len(steps):
        return 1.0
    step = float(np.median(steps))
    for seconds in _TIME_UNITS.values():
        if _SHORTEST_STEP <= step * seconds <= _LONGEST_STEP:
            return seconds
    raise DatasetError(
        f"{path}: the usual step between samples is {step:g}, which is no step of an IMU in s, ms, "
        "us or ns; is the first column the time?"
    )
