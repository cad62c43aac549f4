# SPDX-License-Identifier: BSD-3-Clause
"""The table of the IMU over time: imu_states.csv."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from orbslam2py._files import atomic_write
from orbslam2py.runs.result import FrameRow
from orbslam2py.slam.records import InertialState

#: Columns after the number of the frame and its time stamp.
IMU_COLUMNS = (
    *("vx", "vy", "vz", "gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
    *("accel_bias_x", "accel_bias_y", "accel_bias_z"),
    *("gravity_tilt_deg", "gravity_std_deg", "innovation"),
)


def has_imu_states(rows: Sequence[FrameRow]) -> bool:
    """Whether the IMU was used for any frame."""
    return any(row.record is not None and row.record.inertial is not None for row in rows)


def write_imu_states(path: Path, rows: Iterable[FrameRow]) -> None:
    """Write one line for every frame for which the IMU was used.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["frame", "timestamp", *IMU_COLUMNS])
    for row in rows:
        if row.record is not None and row.record.inertial is not None:
            writer.writerow([row.index, row.timestamp, *_fields(row.record.inertial)])
    with atomic_write(path) as file:
        file.write(stream.getvalue())


def _fields(state: InertialState) -> list[str]:
    numbers = [
        *(state.velocity, state.gyro_bias, state.accel_bias),
        np.degrees([state.gravity_tilt, state.gravity_deviation]),
    ]
    innovation = "" if state.innovation is None else f"{state.innovation:.3f}"
    return [*(f"{value:.6f}" for value in np.concatenate(numbers)), innovation]
