# SPDX-License-Identifier: BSD-3-Clause
"""Reading of trajectories in the formats of data sets and other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orbslam2py._arguments import array_of, choice_of
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.columns import Columns, QuaternionOrder, timed_columns
from orbslam2py.trajectory.parsing import columns_of, no_trajectory, numbers_in
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    nearest_rotations,
    poses_from,
    rotations_from_quaternions,
)
from orbslam2py.trajectory.table import TextTable, read_table
from orbslam2py.trajectory.time_units import TimeUnit, unit_by_digits
from orbslam2py.trajectory.trajectory import Trajectory
from orbslam2py.trajectory.writers import TrajectoryFormat


@dataclass(frozen=True)
class Reading:
    """The conventions of the numbers in a trajectory file.

    Attributes
    ----------
    quaternions
        Order of the quaternions; None for matrices, and for poses without a file.
    order_is_known
        Whether the order was given, or is in the header of the file.
    inverse
        Whether the file has poses of the world in the camera, which were inverted.
    unit
        Unit of the times in the file; None if it has none.
    is_file
        Whether the poses are from a file, so that another reading is possible.
    notes
        Differences of the file from plain TUM, KITTI or EuRoC, for messages.
    """

    quaternions: QuaternionOrder | None = None
    order_is_known: bool = True
    inverse: bool = False
    unit: TimeUnit | None = None
    is_file: bool = True
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class TrajectoryFile:
    """A trajectory, and the conventions of its file.

    Attributes
    ----------
    trajectory
        The poses, with times in seconds.
    file_format
        Format of the file.
    reading
        The conventions of its numbers.
    """

    trajectory: Trajectory
    file_format: TrajectoryFormat
    reading: Reading


def read_tum(path: str | Path) -> Trajectory:
    """Read ``time tx ty tz qx qy qz qw`` lines; ``#`` starts a comment.

    Separators, headers, further columns and units of time are as in `read_trajectory`.

    Returns
    -------
    Trajectory
        Poses ``T_wc``; quaternions need not have unit length.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    return _read(path, TrajectoryFormat.TUM).trajectory


def read_kitti(path: str | Path, timestamps: FloatArray | None = None) -> Trajectory:
    """Read 12 numbers per line, the upper three rows of ``T_wc``; or 16, with the fourth.

    Parameters
    ----------
    path
        The file.
    timestamps
        Times of the frames [s] from ``times.txt``; without it, the time is the number of the frame.

    Raises
    ------
    DatasetError
        The message names file and line; also if there are more poses than time stamps.
    """
    trajectory = _read(path, TrajectoryFormat.KITTI).trajectory
    n = len(trajectory)
    if timestamps is None:
        return trajectory
    stamps = array_of(timestamps, "timestamps", (-1,))
    if n > len(stamps):
        raise DatasetError(f"{path}: {n} poses for {len(stamps)} time stamps")
    return Trajectory(stamps[:n], trajectory.T_wc)


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
    return _read(path, TrajectoryFormat.EUROC).trajectory


def read_trajectory(
    path: str | Path,
    file_format: TrajectoryFormat | str = TrajectoryFormat.AUTO,
    *,
    quaternions: QuaternionOrder | str | None = None,
    inverse: bool = False,
) -> tuple[Trajectory, TrajectoryFormat]:
    """Read a trajectory in any of the layouts of `TRAJECTORY_LAYOUTS`.

    Parameters
    ----------
    path, file_format, quaternions, inverse
        As of `read_trajectory_file`.

    Returns
    -------
    Trajectory
        Trajectory; its times are numbers of frames for KITTI, and its poses those of the body for
        EuRoC.
    TrajectoryFormat
        Format of the file.

    Raises
    ------
    DatasetError
        If the file is missing, empty or no trajectory.
    """
    read = read_trajectory_file(path, file_format, quaternions=quaternions, inverse=inverse)
    return read.trajectory, read.file_format


def read_trajectory_file(
    path: str | Path,
    file_format: TrajectoryFormat | str = TrajectoryFormat.AUTO,
    *,
    quaternions: QuaternionOrder | str | None = None,
    inverse: bool = False,
) -> TrajectoryFile:
    """Read a trajectory in any of the layouts of `TRAJECTORY_LAYOUTS`, with its conventions.

    Separators are spaces, tabs, commas or semicolons. A header gives the order of the columns.
    Times are in s, ms, us or ns, depending on their size.

    Parameters
    ----------
    path
        The file.
    file_format
        The format; by default recognised by the content.
    quaternions
        Order of the quaternions; by default that of the header, or of the format.
    inverse
        Whether the file has poses of the world in the camera, ``T_cw``.

    Raises
    ------
    DatasetError
        If the file is missing, empty or no trajectory; if an order is given for matrices.
    """
    file_format = TrajectoryFormat.of(file_format)
    order = None if quaternions is None else QuaternionOrder.of(quaternions)
    read = _read(path, file_format, order, inverse=choice_of(inverse, "inverse"))
    if not len(read.trajectory):
        raise DatasetError(f"{path} holds no poses; give a file with one per line")
    return read


def _read(
    path: str | Path,
    file_format: TrajectoryFormat,
    order: QuaternionOrder | None = None,
    *,
    inverse: bool = False,
) -> TrajectoryFile:
    table = read_table(path)
    if not table.rows:
        return _without_rows(table, file_format)
    columns = columns_of(table, file_format)
    values = numbers_in(table, columns)
    if columns.matrix and order is not None:
        raise DatasetError(
            f"{path} holds matrices, no quaternions; leave out the order of the quaternions"
        )
    stamps, unit = _seconds(table, columns, values, file_format)
    if file_format is TrajectoryFormat.AUTO:
        file_format = _format_of(table, columns, unit)
    chosen = order or columns.order or _usual_order(file_format)
    if columns.matrix:
        T_wc = _poses_of_matrices(path, values[:, -12:].reshape(-1, 3, 4))
    else:
        xyzw = _xyzw(values[:, -4:], columns, chosen, is_given=order is not None)
        T_wc = _poses(path, values[:, -7:-4], xyzw)
    reading = Reading(
        None if columns.matrix else chosen,
        columns.matrix != () or order is not None or columns.order is not None,
        inverse,
        unit,
        notes=_notes(columns, chosen, unit, file_format),
    )
    return TrajectoryFile(
        Trajectory(stamps, inverse_poses(T_wc) if inverse else T_wc), file_format, reading
    )


def _format_of(table: TextTable, columns: Columns, unit: TimeUnit | None) -> TrajectoryFormat:
    """Return whether a file is EuRoC's: times in ns with commas or a header, and w first."""
    if columns.time is None:
        return TrajectoryFormat.KITTI
    in_ns = unit is TimeUnit.NANOSECONDS and (table.has_commas or columns.is_named)
    w_first = columns.order in (None, QuaternionOrder.WXYZ)
    if in_ns and w_first and not columns.matrix:
        return TrajectoryFormat.EUROC
    return TrajectoryFormat.TUM


def _usual_order(file_format: TrajectoryFormat) -> QuaternionOrder:
    is_euroc = file_format is TrajectoryFormat.EUROC
    return QuaternionOrder.WXYZ if is_euroc else QuaternionOrder.XYZW


def _xyzw(
    values: FloatArray, columns: Columns, order: QuaternionOrder, *, is_given: bool
) -> FloatArray:
    """Convert quaternions (n, 4) to the order x, y, z, w."""
    if columns.order is not None:
        if not is_given:
            return values  # the head names each
        values = values[:, np.argsort(columns.quaternion)]
    return values if order is QuaternionOrder.XYZW else values[:, [1, 2, 3, 0]]


def _without_rows(table: TextTable, file_format: TrajectoryFormat) -> TrajectoryFile:
    if not all(head.is_comment for head in table.heads):
        raise no_trajectory(table)
    return TrajectoryFile(
        Trajectory(np.zeros(0), np.zeros((0, 4, 4))), file_format, Reading(unit=None)
    )


def _seconds(
    table: TextTable, columns: Columns, values: FloatArray, file_format: TrajectoryFormat
) -> tuple[FloatArray, TimeUnit | None]:
    if columns.time is None:
        return np.arange(len(values), dtype=np.float64), None
    texts = [line.fields[columns.time].strip() for line in table.rows]
    are_whole = np.array([text.isdecimal() for text in texts])
    if file_format is not TrajectoryFormat.EUROC:
        unit = unit_by_digits(values[:, 0], columns.unit)
    elif are_whole.all():
        unit = TimeUnit.NANOSECONDS
    else:
        bad = int(are_whole.argmin())
        raise DatasetError(
            f"{table.path}:{table.rows[bad].number}: '{texts[bad]}' is not a time in ns; name "
            "another format"
        )
    if unit is not TimeUnit.SECONDS and are_whole.all():
        # Of whole numbers, which floats do not hold to the last digit, the quotient is exact.
        return np.array([int(text) / unit.per_second for text in texts]), unit
    return values[:, 0] / unit.per_second, unit


def _notes(
    columns: Columns, order: QuaternionOrder, unit: TimeUnit | None, file_format: TrajectoryFormat
) -> tuple[str, ...]:
    notes = []
    is_euroc = file_format is TrajectoryFormat.EUROC
    usual = TimeUnit.NANOSECONDS if is_euroc else TimeUnit.SECONDS
    if unit not in (None, usual):
        notes.append(f"times in {unit}")
    if columns.matrix:
        if columns.time is not None:
            notes.append("a time before every matrix")
        return tuple(notes)
    as_usual = timed_columns(0)
    if is_euroc and not columns.is_named:
        notes.append("times in ns and quaternions w first, as EuRoC and VINS write them")
    elif (columns.time, columns.position) != (as_usual.time, as_usual.position) or (
        columns.is_named and order is not _usual_order(file_format)
    ):
        where = ", ".join(str(column + 1) for column in sorted(columns.used))
        told = "as its head says" if columns.is_named else "recognised by their values"
        w = "last" if order is QuaternionOrder.XYZW else "first"
        notes.append(f"poses in the columns {where}, w {w} ({told})")
    return tuple(notes)


def _poses_of_matrices(path: str | Path, matrices: FloatArray) -> FloatArray:
    if (np.abs(np.linalg.det(matrices[:, :, :3]) - 1) > 0.5).any():  # mirrored, or scaled
        raise DatasetError(
            f"{path}: not all poses hold rotations; a row is the upper three rows of T_wc"
        )
    return poses_from(nearest_rotations(matrices[:, :, :3]), matrices[:, :, 3])


def _poses(path: str | Path, positions: FloatArray, quaternions: FloatArray) -> FloatArray:
    norms = np.linalg.norm(quaternions, axis=1)
    if np.any(norms < 1e-6):
        raise DatasetError(
            f"{path}: the quaternion of pose {int(norms.argmin())} is zero; a pose is tx ty tz "
            "qx qy qz qw"
        )
    return poses_from(rotations_from_quaternions(quaternions), positions)
