# SPDX-License-Identifier: BSD-3-Clause
"""Poses of KITTI raw: latitude, longitude, altitude, roll, pitch, yaw of the car's navigation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import poses_from

_EARTH_RADIUS = 6378137.0  # metres, WGS 84
_FIELDS = 6
#: With the accelerations and the angular rates, which come after the velocities.
_IMU_FIELDS = 20


def read_oxts(folder: Path, n_times: int) -> tuple[list[int], FloatArray]:
    """Read the packets of a drive.

    Parameters
    ----------
    folder
        ``oxts/data``, with a file per packet: ``0000000000.txt``.
    n_times
        Number of time stamps.

    Returns
    -------
    numbers, T_w_imu
        Numbers of the packets, and the poses (n, 4, 4) of the IMU (x forward, y left, z up) in a
        world in metres: x east, y north, z up, with the first position as origin.

    Raises
    ------
    DatasetError
        Naming the file.
    """
    files, numbers = _packets(folder, n_times)
    values = np.array([_values(path) for path in files])
    latitude, longitude = np.radians(values[:, 0]), np.radians(values[:, 1])
    scale = _EARTH_RADIUS * np.cos(latitude[0])
    east, north = scale * longitude, scale * np.log(np.tan(np.pi / 4 + latitude / 2))
    positions = np.column_stack([east, north, values[:, 2]])
    roll, pitch, yaw = values[:, 3:6].T
    R = _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)
    return numbers, poses_from(R, positions - positions[0])


def read_oxts_imu(folder: Path, n_times: int) -> tuple[list[int], FloatArray]:
    """Read angular rates [rad/s] and accelerations [m/s^2] of the packets of a drive.

    Parameters
    ----------
    folder, n_times
        As for `read_oxts`.

    Returns
    -------
    numbers, readings
        Numbers of the packets, and rows wx, wy, wz, ax, ay, az, (n, 6); x points forward, y left,
        z up.

    Raises
    ------
    DatasetError
        Naming the file.
    """
    files, numbers = _packets(folder, n_times)
    values = np.array([_values(path, _IMU_FIELDS) for path in files])
    return numbers, np.hstack([values[:, 17:20], values[:, 11:14]])


def _packets(folder: Path, n_times: int) -> tuple[list[Path], list[int]]:
    files = sorted(path for path in folder.glob("*.txt") if path.stem.isdecimal())
    if not files:
        raise DatasetError(f"{folder} has no packets (0000000000.txt ...); take oxts away")
    numbers = [int(path.stem) for path in files]
    if numbers[-1] >= n_times:
        raise DatasetError(
            f"{folder.parent / 'timestamps.txt'} holds {n_times} time stamps, but there is "
            f"{files[-1]}; copy the drive's own file there, or take oxts away"
        )
    return files, numbers


def _values(path: Path, n_fields: int = _FIELDS) -> list[float]:
    for line in content_lines(path)[:1]:
        if len(line.fields) >= n_fields:
            return [number_of(path, line, field) for field in line.fields[:n_fields]]
    raise DatasetError(
        f"{path} does not begin with latitude, longitude, altitude, roll, pitch and yaw"
        f"{' and all readings' if n_fields > _FIELDS else ''}; copy it again, or take oxts away"
    )


def _about(axis: int, angles: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) about an axis [rad]."""
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    R = np.zeros((len(angles), 3, 3))
    R[:, axis, axis] = 1.0
    R[:, a, a] = R[:, b, b] = np.cos(angles)
    R[:, a, b], R[:, b, a] = -np.sin(angles), np.sin(angles)
    return R
