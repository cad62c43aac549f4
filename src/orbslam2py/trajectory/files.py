# SPDX-License-Identifier: BSD-3-Clause
"""Files of trajectories in the formats of TUM, KITTI and EuRoC."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._files import atomic_write
from orbslam2py._text_lines import content_lines, numbers_of
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import (
    nearest_rotations,
    poses_from,
    quaternions_from_rotations,
    rotations_from_quaternions,
)
from orbslam2py.trajectory.trajectory import Trajectory

_EUROC_HEADER = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],"
    "q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
)


class TrajectoryFormat(str, Enum):
    """Formats of trajectory files."""

    AUTO = "auto"
    """Whichever the content of the file shows."""
    TUM = "tum"
    """``time tx ty tz qx qy qz qw``, camera to world."""
    KITTI = "kitti"
    """The upper three rows of a pose, camera to world, per frame; no time stamps."""
    EUROC = "euroc"
    """``ns, px, py, pz, qw, qx, qy, qz``, body to world."""

    def __str__(self) -> str:
        return self.value


# ---- writing -------------------------------------------------------------------------------------


def write_tum(
    path: str | Path, trajectory: Trajectory, timestamp_texts: Sequence[str] | None = None
) -> None:
    """Write ``time tx ty tz qx qy qz qw`` for every pose that is not lost.

    Parameters
    ----------
    path
        The file; replaced only when everything was written.
    trajectory
        Poses; positions and quaternions (camera to world) get 9 decimals.
    timestamp_texts
        The source's text of every time stamp, so that no digit is lost; 6 decimals without.

    Raises
    ------
    OSError
        If the file cannot be written.
    ValueError
        If there is not one text per pose.
    """
    if timestamp_texts is not None and len(timestamp_texts) != len(trajectory):
        raise ValueError(f"{len(trajectory)} poses, but {len(timestamp_texts)} time stamp texts")
    quaternions = quaternions_from_rotations(trajectory.T_wc[:, :3, :3])
    with atomic_write(path) as stream:
        for i in np.flatnonzero(~trajectory.lost):
            stamp = (
                timestamp_texts[int(i)] if timestamp_texts else f"{trajectory.timestamps[i]:.6f}"
            )
            values = (*trajectory.positions[i], *quaternions[i])
            stream.write(f"{stamp} {_decimals(values)}\n")


def write_kitti(path: str | Path, trajectory: Trajectory, n_frames: int | None = None) -> None:
    """Write 12 numbers per input frame: the upper three rows of ``T_wc``.

    KITTI's tools want one line for each frame, so the frames before the first pose get the
    identity and later ones without a pose repeat the one before.

    Parameters
    ----------
    path
        The file; replaced only when everything was written.
    trajectory
        Poses with the numbers of their frames in `Trajectory.indices`.
    n_frames
        Number of lines; by default up to the last pose.

    Raises
    ------
    OSError
        If the file cannot be written.
    ValueError
        If the indices are not increasing or lie beyond `n_frames`.
    """
    indices = trajectory.indices
    last = int(indices[-1]) + 1 if len(indices) else 0
    n_lines = last if n_frames is None else n_frames
    if np.any(np.diff(indices) <= 0) or last > n_lines or np.any(indices < 0):
        raise ValueError(f"frame numbers must increase within 0 to {n_lines - 1}")
    # For each line the last pose at or before it; -1 where there is none yet.
    source = np.searchsorted(indices, np.arange(n_lines), side="right") - 1
    with atomic_write(path) as stream:
        for i in source:
            T = trajectory.T_wc[i] if i >= 0 else np.eye(4)
            stream.write(_decimals(T[:3].ravel()) + "\n")


def write_euroc(
    path: str | Path, trajectory: Trajectory, timestamp_texts: Sequence[str] | None = None
) -> None:
    """Write ``ns, px, py, pz, qw, qx, qy, qz`` for every pose that is not lost, below a header.

    The layout of EuRoC's ``data.csv`` (Burri et al., IJRR 2016); its tools take the poses for those
    of the body, so multiply `T_wc` by the inverse of ``T_BS`` first if that is what they compare.

    Parameters
    ----------
    path
        The file; replaced only when everything was written.
    trajectory
        Poses; positions and quaternions get 9 decimals.
    timestamp_texts
        The source's text of every time stamp in decimal seconds, so that no nanosecond is lost;
        rounded to microseconds without.

    Raises
    ------
    OSError
        If the file cannot be written.
    ValueError
        If there is not one text per pose.
    """
    if timestamp_texts is not None and len(timestamp_texts) != len(trajectory):
        raise ValueError(f"{len(trajectory)} poses, but {len(timestamp_texts)} time stamp texts")
    texts = timestamp_texts or [f"{t:.6f}" for t in trajectory.timestamps]
    xyzw = quaternions_from_rotations(trajectory.T_wc[:, :3, :3])
    with atomic_write(path) as stream:
        stream.write(_EUROC_HEADER)
        for i in np.flatnonzero(~trajectory.lost).tolist():
            nanoseconds = int(Decimal(texts[i]).scaleb(9).to_integral_value())
            values = (*trajectory.positions[i], xyzw[i, 3], *xyzw[i, :3])
            stream.write(f"{nanoseconds},{_decimals(values).replace(' ', ',')}\n")


def _decimals(values: Any) -> str:
    # Adding 0.0 turns a negative zero, which says nothing, into a plain one.
    return " ".join(f"{round(float(value), 9) + 0.0:.9f}" for value in values)


# ---- reading -------------------------------------------------------------------------------------


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
    stamps = np.arange(len(table), dtype=np.float64) if timestamps is None else timestamps
    if len(table) > len(stamps):
        raise DatasetError(f"{path}: {len(table)} poses for {len(stamps)} time stamps")
    if len(table) and np.linalg.det(table[:, :, :3]).min() < 0.5:
        raise DatasetError(f"{path}: not all poses hold rotations")
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
            raise DatasetError(f"{path}:{line.number}: '{nanoseconds}' is not a time in ns")
        rows.append(numbers_of(path, line, (8, 17))[:8])
        rows[-1][0] = int(nanoseconds) / 1e9
    table = _table(path, rows, 8)
    return Trajectory(table[:, 0], _poses(path, table[:, 1:4], table[:, [5, 6, 7, 4]]))


def read_trajectory(
    path: str | Path, file_format: TrajectoryFormat = TrajectoryFormat.AUTO
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
    if file_format is TrajectoryFormat.AUTO:
        file_format = _recognise_format(path)
    readers = {
        TrajectoryFormat.TUM: read_tum,
        TrajectoryFormat.KITTI: read_kitti,
        TrajectoryFormat.EUROC: read_euroc,
    }
    trajectory = readers[file_format](path)
    if not len(trajectory):
        raise DatasetError(f"{path} holds no poses")
    return trajectory, file_format


def _recognise_format(path: str | Path) -> TrajectoryFormat:
    first = next(iter(content_lines(path)), None)
    if first is None:
        raise DatasetError(f"{path} holds no poses")
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
        raise DatasetError(f"{path}: pose {bad} holds a number that is not finite")
    return table


def _poses(path: str | Path, positions: FloatArray, quaternions: FloatArray) -> FloatArray:
    norms = np.linalg.norm(quaternions, axis=1)
    if np.any(norms < 1e-6):
        raise DatasetError(f"{path}: the quaternion of pose {int(norms.argmin())} is zero")
    return poses_from(rotations_from_quaternions(quaternions), positions)
