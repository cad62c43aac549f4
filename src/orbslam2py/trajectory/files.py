# SPDX-License-Identifier: BSD-3-Clause
"""Reading trajectories in the formats of TUM, KITTI and EuRoC."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arguments import array_of
from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, numbers_of
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import (
    nearest_rotations,
    poses_from,
    rotations_from_quaternions,
)
from orbslam2py.trajectory.trajectory import Trajectory
from orbslam2py.trajectory.writers import TrajectoryFormat


def read_tum(path: str | Path) -> Trajectory:
    """Read ``time tx ty tz qx qy qz qw`` lines; ``#`` starts a comment.

    Returns
    -------
    Trajectory
        Poses ``T_wc``; quaternions need not have unit length.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    rows = [numbers_of(path, line, (8,)) for line in content_lines(path)]
    table = _table(path, rows, 8)
    return Trajectory(table[:, 0], _poses(path, table[:, 1:4], table[:, 4:8]))


def read_kitti(path: str | Path, timestamps: FloatArray | None = None) -> Trajectory:
    """Read 12 numbers per line, the upper three rows of ``T_wc``.

    Parameters
    ----------
    path
        The file.
    timestamps
        Times of the frames [s] from ``times.txt``; without, the number of the frame stands for
        the time.

    Raises
    ------
    DatasetError
        Naming file and line; also if there are more poses than time stamps.
    """
    rows = [numbers_of(path, line, (12,)) for line in content_lines(path)]
    table = _table(path, rows, 12).reshape(-1, 3, 4)
    stamps = np.arange(len(table), dtype=np.float64)
    if timestamps is not None:
        stamps = array_of(timestamps, "timestamps", (-1,))
    if len(table) > len(stamps):
        raise DatasetError(f"{path}: {len(table)} poses for {len(stamps)} time stamps")
    if len(table) and np.linalg.det(table[:, :, :3]).min() < 0.5:
        raise DatasetError(
            f"{path}: not all poses hold rotations; a row is the upper three rows of T_wc"
        )
    return Trajectory(
        stamps[: len(table)], poses_from(nearest_rotations(table[:, :, :3]), table[:, :, 3])
    )


def read_euroc(path: str | Path) -> Trajectory:
    """Read EuRoC's ground truth ``ns, px, py, pz, qw, qx, qy, qz[, ...]``.

    Returns
    -------
    Trajectory
        Poses of the vehicle's BODY; multiply `T_wc` by ``T_BS`` of a camera for its poses.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    rows = []
    for line in content_lines(path, separator=","):
        nanoseconds = line.fields[0]
        if not nanoseconds.isdigit():
            raise DatasetError(
                f"{path}:{line.number}: '{nanoseconds}' is not a time in ns; name another format"
            )
        rows.append(numbers_of(path, line, (8, 17))[:8])
        rows[-1][0] = int(nanoseconds) / 1e9
    table = _table(path, rows, 8)
    return Trajectory(table[:, 0], _poses(path, table[:, 1:4], table[:, [5, 6, 7, 4]]))


def read_trajectory(
    path: str | Path, file_format: TrajectoryFormat | str = TrajectoryFormat.AUTO
) -> tuple[Trajectory, TrajectoryFormat]:
    """Read a trajectory in any of the formats.

    Parameters
    ----------
    path
        The file.
    file_format
        What it is; by default told by its content.

    Returns
    -------
    Trajectory
        With the number of the frame as time for KITTI, and body poses for EuRoC.
    TrajectoryFormat
        What the file is.

    Raises
    ------
    DatasetError
        If the file is missing, empty or not in the format.
    """
    file_format = TrajectoryFormat.of(file_format)
    if file_format is TrajectoryFormat.AUTO:
        file_format = _recognise_format(path)
    readers = {
        TrajectoryFormat.TUM: read_tum,
        TrajectoryFormat.KITTI: read_kitti,
        TrajectoryFormat.EUROC: read_euroc,
    }
    trajectory = readers[file_format](path)
    if not len(trajectory):
        raise DatasetError(f"{path} holds no poses; give a file with one per line")
    return trajectory, file_format


def _recognise_format(path: str | Path) -> TrajectoryFormat:
    first = next(iter(content_lines(path)), None)
    if first is None:
        raise DatasetError(f"{path} holds no poses; give a file with one per line")
    if "," in "".join(first.fields):
        return TrajectoryFormat.EUROC
    by_count = {8: TrajectoryFormat.TUM, 12: TrajectoryFormat.KITTI}
    if len(first.fields) not in by_count:
        raise DatasetError(
            f"{path}:{first.number}: {len(first.fields)} fields; a trajectory has 8 (TUM), "
            "12 (KITTI) or comma-separated ones (EuRoC)"
        )
    return by_count[len(first.fields)]


def _table(path: str | Path, rows: list[list[float]], columns: int) -> FloatArray:
    table = np.array(rows, dtype=np.float64).reshape(-1, columns)
    if not np.isfinite(table).all():
        bad = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise DatasetError(
            f"{path}: pose {bad} holds a number that is not finite; correct it or leave it out"
        )
    return table


def _poses(path: str | Path, positions: FloatArray, quaternions: FloatArray) -> FloatArray:
    norms = np.linalg.norm(quaternions, axis=1)
    if np.any(norms < 1e-6):
        raise DatasetError(
            f"{path}: the quaternion of pose {int(norms.argmin())} is zero; a pose is tx ty tz "
            "qx qy qz qw"
        )
    return poses_from(rotations_from_quaternions(quaternions), positions)
