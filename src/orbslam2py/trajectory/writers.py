# SPDX-License-Identifier: BSD-3-Clause
"""Formats of trajectory files, and writing them.

Separate from reading, so that a `Trajectory` can save itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from enum import Enum
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from orbslam2py._arguments import is_whole, member_of, shown
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._files import atomic_write
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import quaternions_from_rotations, require_poses


class TimedPoses(Protocol):
    """The parts of an `orbslam2py.Trajectory` that are written; see its attributes."""

    @property
    def timestamps(self) -> FloatArray: ...  # noqa: D102
    @property
    def T_wc(self) -> FloatArray: ...  # noqa: D102
    @property
    def positions(self) -> FloatArray: ...  # noqa: D102
    @property
    def lost(self) -> npt.NDArray[np.bool_]: ...  # noqa: D102
    @property
    def indices(self) -> IntArray: ...  # noqa: D102
    def __len__(self) -> int: ...


_EUROC_HEADER = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],"
    "q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
)


class TrajectoryFormat(str, Enum):
    """Formats of trajectory files."""

    AUTO = "auto"
    """Recognised by the content of the file."""
    TUM = "tum"
    """``time tx ty tz qx qy qz qw``, camera to world."""
    KITTI = "kitti"
    """The upper three rows of a pose, camera to world, per frame; no time stamps."""
    EUROC = "euroc"
    """``ns, px, py, pz, qw, qx, qy, qz``, body to world."""

    @classmethod
    def of(cls, value: TrajectoryFormat | str) -> TrajectoryFormat:
        """Take a format or its name.

        Raises
        ------
        DatasetError
            For an unknown name; the message lists the names.
        """
        return member_of(cls, value, "the format of the trajectory")

    def __str__(self) -> str:
        return self.value


def write_tum(
    path: str | Path, trajectory: TimedPoses, timestamp_texts: Sequence[str] | None = None
) -> None:
    """Write ``time tx ty tz qx qy qz qw`` for every pose that is not lost.

    Parameters
    ----------
    path
        The file; replaced only after everything is written.
    trajectory
        Poses; positions and quaternions (camera to world) get 9 decimals.
    timestamp_texts
        The source's text of every time stamp, so that no digit is lost; None: 6 decimals.

    Raises
    ------
    OSError
        If the file cannot be written.
    DatasetError
        If the number of texts differs from that of poses, or a pose is invalid: not finite, or
        without a rotation.
    """
    _check(trajectory)
    require_poses(trajectory.T_wc, ~trajectory.lost, "the trajectory")
    if timestamp_texts is not None:
        _check_texts(timestamp_texts, len(trajectory))
    quaternions = quaternions_from_rotations(trajectory.T_wc[:, :3, :3])
    with atomic_write(path) as stream:
        for i in np.flatnonzero(~trajectory.lost):
            stamp = (
                timestamp_texts[int(i)] if timestamp_texts else f"{trajectory.timestamps[i]:.6f}"
            )
            values = (*trajectory.positions[i], *quaternions[i])
            stream.write(f"{stamp} {_decimals(values)}\n")


def write_kitti(path: str | Path, trajectory: TimedPoses, n_frames: int | None = None) -> None:
    """Write 12 numbers per input frame: the upper three rows of ``T_wc``.

    KITTI's tools need one line for each frame: the frames before the first pose get the identity,
    and later ones without a pose repeat the one before.

    Parameters
    ----------
    path
        The file; replaced only after everything is written.
    trajectory
        Poses with the numbers of their frames in `Trajectory.indices`.
    n_frames
        Number of lines; by default up to the last pose.

    Raises
    ------
    OSError
        If the file cannot be written.
    DatasetError
        If the indices do not increase or exceed `n_frames`, or a pose is invalid: not finite, or
        without a rotation.
    """
    _check(trajectory)
    require_poses(trajectory.T_wc, np.ones(len(trajectory), bool), "the trajectory")
    if n_frames is not None and not is_whole(n_frames):
        raise DatasetError(f"n_frames is {shown(n_frames)}; give a number of lines, or None")
    indices = trajectory.indices
    last = int(indices[-1]) + 1 if len(indices) else 0
    n_lines = last if n_frames is None else n_frames
    if np.any(np.diff(indices) <= 0) or last > n_lines or np.any(indices < 0):
        raise DatasetError(
            f"frame numbers must increase within 0 to {n_lines - 1}; select the poses of one run, "
            "or give n_frames"
        )
    # For each line the last pose at or before it; -1 where there is none yet.
    source = np.searchsorted(indices, np.arange(n_lines), side="right") - 1
    with atomic_write(path) as stream:
        for i in source:
            T = trajectory.T_wc[i] if i >= 0 else np.eye(4)
            stream.write(_decimals(T[:3].ravel()) + "\n")


def write_euroc(
    path: str | Path, trajectory: TimedPoses, timestamp_texts: Sequence[str] | None = None
) -> None:
    """Write ``ns, px, py, pz, qw, qx, qy, qz`` for every pose that is not lost, below a header.

    The layout of EuRoC's ``data.csv`` (Burri et al., IJRR 2016). Its tools expect poses of the
    body: to compare these, first multiply `T_wc` by the inverse of ``T_BS``.

    Parameters
    ----------
    path
        The file; replaced only after everything is written.
    trajectory
        Poses; positions and quaternions get 9 decimals.
    timestamp_texts
        The source's text of every time stamp in decimal seconds, so that no nanosecond is lost;
        None: rounded to microseconds.

    Raises
    ------
    OSError
        If the file cannot be written.
    DatasetError
        If the number of texts differs from that of poses, or a pose is invalid: not finite, or
        without a rotation.
    """
    _check(trajectory)
    require_poses(trajectory.T_wc, ~trajectory.lost, "the trajectory")
    if timestamp_texts is not None:
        _check_texts(timestamp_texts, len(trajectory))
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


def _check(trajectory: Any) -> None:
    if not hasattr(trajectory, "T_wc"):
        raise DatasetError(f"the trajectory is {shown(trajectory)}; give an orbslam2py.Trajectory")


def _check_texts(texts: Any, n: int) -> None:
    if not isinstance(texts, Sequence) or not all(isinstance(text, str) for text in texts):
        raise DatasetError(f"the time stamp texts are {shown(texts)}; give a list of text")
    if isinstance(texts, str) or len(texts) != n:
        raise DatasetError(f"{n} poses, but {len(texts)} time stamp texts; give one per pose")
