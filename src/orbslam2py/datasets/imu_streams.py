# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU in two tables, as apps of phones write them: one of the gyro, one of the other.

>>> read_imu_streams("Gyroscope.csv", "Accelerometer.csv")  # doctest: +SKIP
"""

from __future__ import annotations

import re
from pathlib import Path

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.imu import ImuSamples, joined_streams
from orbslam2py.datasets.imu_csv import (
    AccelUnit,
    GyroUnit,
    Table,
    read_table,
    time_unit,
    unit_in,
)
from orbslam2py.errors import DatasetError

_GYRO = re.compile(r"gyr|angular|omega|rotation", re.IGNORECASE)
_ACCEL = re.compile(r"acc|force", re.IGNORECASE)
_TIME = re.compile(r"(time|stamp|seconds|^t\b)", re.IGNORECASE)
_AXIS = re.compile(r"(^|[_\W])(?P<axis>[xyz])$", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[(][^\])]*[\])]")


def read_imu_streams(
    first: str | Path,
    second: str | Path,
    *,
    gyro_unit: GyroUnit | str | None = None,
    accel_unit: AccelUnit | str | None = None,
) -> ImuSamples:
    """Read a table of a gyro and one of an accelerometer, in any order.

    The accelerometer is interpolated at the times of the gyro. It must hold gravity: the linear
    acceleration of some apps does not.

    Parameters
    ----------
    first, second
        Tables with a header that names the time and the columns x, y, z. The header or the name of
        the file says which is which, such as ``Gyroscope.csv``.
    gyro_unit, accel_unit
        Units of the readings; by default those in brackets in the header, else rad/s and m/s^2.

    Raises
    ------
    DatasetError
        Naming the file, the line and the fault.
    """
    streams: dict[str, FloatArray] = {}
    for path in map(Path, (first, second)):
        table = read_table(path, columns=4)
        kind = _kind(path, table)
        if kind in streams:
            raise DatasetError(
                f"{first} and {second} are both tables of the {kind}; give one of the gyro and one "
                "of the accelerometer"
            )
        unit: GyroUnit | AccelUnit
        if kind == "gyro":
            unit = GyroUnit(gyro_unit or unit_in(table.header, GyroUnit) or GyroUnit.RADIANS)
        else:
            unit = AccelUnit(accel_unit or unit_in(table.header, AccelUnit) or AccelUnit.METRES)
        rows = table.numbers(_places(table))
        rows[:, 0] *= time_unit(path, rows[:, 0])
        rows[:, 1:] *= unit.factor
        streams[kind] = rows
    return joined_streams(f"{first} and {second}", streams["gyro"], streams["accelerometer"])


def _kind(path: Path, table: Table) -> str:
    for text in (table.header, path.stem):
        is_gyro, is_accel = bool(_GYRO.search(text)), bool(_ACCEL.search(text))
        if is_gyro != is_accel:
            return "gyro" if is_gyro else "accelerometer"
    raise DatasetError(
        f"{path}: neither its header nor its name says whether it is of the gyro or the "
        "accelerometer; name the file gyro.csv or accelerometer.csv"
    )


def _places(table: Table) -> tuple[int, ...]:
    """Columns of the time and of x, y, z."""
    names = [_BRACKETS.sub("", field).strip().strip('"').strip() for field in table.fields]
    axes: dict[str, int] = {}
    for place, name in enumerate(names):
        match = _AXIS.search(name)
        if match and not _TIME.search(name):
            axes.setdefault(match["axis"].lower(), place)
    times = [place for place, name in enumerate(names) if _TIME.search(name)]
    missing = [
        name for name, there in (("time", times), *((a, a in axes) for a in "xyz")) if not there
    ]
    if missing:
        raise DatasetError(
            f"{table.path}: the header names no column {', '.join(missing)}; name the columns "
            "time, x, y, z"
        )
    return times[0], axes["x"], axes["y"], axes["z"]
