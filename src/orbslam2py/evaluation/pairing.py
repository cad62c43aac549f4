# SPDX-License-Identifier: BSD-3-Clause
"""Poses of two files on one clock: by time, by known frame numbers, or not at all.

A row of a file in KITTI format has no time. It is compared only if the time is known otherwise:
from ``frames.csv`` of its run, from a list of times, or because both files have a row for every
frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory import (
    FrameTable,
    QuaternionOrder,
    Reading,
    Trajectory,
    TrajectoryFormat,
    read_frame_table,
    read_times,
    read_trajectory_file,
    unit_by_other,
)
from orbslam2py.trajectory.frame_times import is_frame_table

_SAME_TIME = 1e-6  # [s]
_OF_NO_FILE = Reading(is_file=False)
_END = 0.02  # part of a sequence that may be without a true pose at its end


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of a file, and all that is known about their times.

    Attributes
    ----------
    source
        The file, for messages.
    trajectory
        The poses; time stamps are numbers of rows if `is_timed` is False.
    file_format
        Of the file.
    is_timed
        Whether the time stamps are times.
    frames
        The frames of the run of the file; None if they are not known, or not read.
    frame_times
        Time of every frame of the sequence [s], (n,); None if it is not known.
    frame_table
        The run's ``frames.csv`` beside the file, which contains `frames`; None if there is none.
    reading
        The format and conventions of the file.
    T_body_camera
        Factor that turned poses of a body into those of the camera, float64 (4, 4); None if there
        is none.
    """

    source: str
    trajectory: Trajectory
    file_format: TrajectoryFormat
    is_timed: bool = True
    frames: FrameTable | None = None
    frame_times: FloatArray | None = None
    frame_table: Path | None = None
    reading: Reading = _OF_NO_FILE
    T_body_camera: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Paired:
    """Two trajectories whose time stamps can be compared.

    Attributes
    ----------
    estimate, truth
        On one clock.
    by
        Description of the matching, for messages.
    is_timed
        Whether the time stamps are seconds; otherwise numbers of rows.
    on_clocks
        Whether both have their own time stamps, so that an offset is useful.
    readings
        The formats and conventions of both files.
    """

    estimate: Trajectory
    truth: Trajectory
    by: str
    is_timed: bool = True
    on_clocks: bool = True
    readings: tuple[Reading, Reading] = (_OF_NO_FILE, _OF_NO_FILE)


def read_estimate(
    path: Path,
    file_format: TrajectoryFormat = TrajectoryFormat.AUTO,
    *,
    times: FloatArray | None = None,
    quaternions: QuaternionOrder | None = None,
    inverse: bool = False,
) -> Poses:
    """Read an estimate, with ``frames.csv`` or ``times.txt`` beside it.

    In KITTI format, rows for frames without a pose are marked as lost. ``frames.csv`` lists these
    frames. Without this file they are identities at the beginning and repetitions of the row
    before. For a file with time stamps, ``frames.csv`` is read only if needed, and never for a file
    of another program.

    Parameters
    ----------
    path, file_format
        The file, and its format.
    times
        Times of the frames [s], (n,); used if there are as many as rows, and no ``frames.csv``.
    quaternions, inverse
        Order of the quaternions, and whether poses are those of the world in the camera; see
        `read_trajectory_file`.

    Raises
    ------
    DatasetError
        If a file is missing or malformed.
    """
    read = read_trajectory_file(path, file_format, quaternions=quaternions, inverse=inverse)
    trajectory, file_format, reading = read.trajectory, read.file_format, read.reading
    beside = path.parent / "frames.csv"
    table = beside if is_frame_table(beside) else None
    if file_format is not TrajectoryFormat.KITTI:
        return Poses(str(path), trajectory, file_format, frame_table=table, reading=reading)
    frames = None if table is None else read_frame_table(table)
    if frames is not None and len(frames) == len(trajectory):
        lost = ~frames.has_pose | _before_the_map(trajectory.T_wc)
        trajectory = Trajectory(frames.timestamps, trajectory.T_wc, lost, frames.indices)
        return Poses(
            *(str(path), trajectory, file_format),
            frames=frames,
            frame_table=table,
            reading=reading,
        )
    lost = rows_without_pose(trajectory.T_wc)
    trajectory = Trajectory(trajectory.timestamps, trajectory.T_wc, lost)
    poses = Poses(str(path), trajectory, file_format, is_timed=False, reading=reading)
    return _with_times(poses, path, times)


def read_truth(
    path: Path,
    file_format: TrajectoryFormat = TrajectoryFormat.AUTO,
    *,
    times: FloatArray | None = None,
    quaternions: QuaternionOrder | None = None,
    inverse: bool = False,
) -> Poses:
    """Read true poses, with ``times.txt`` beside them or in the place of KITTI's benchmark.

    Parameters
    ----------
    path, file_format
        The file, and its format.
    times
        Times of its poses [s], (n,); used if there are as many as rows in KITTI format.
    quaternions, inverse
        As of `read_estimate`.

    Raises
    ------
    DatasetError
        If a file is missing or malformed.
    """
    read = read_trajectory_file(path, file_format, quaternions=quaternions, inverse=inverse)
    trajectory, file_format, reading = read.trajectory, read.file_format, read.reading
    timed = file_format is not TrajectoryFormat.KITTI
    poses = Poses(str(path), trajectory, file_format, timed, reading=reading)
    return _with_times(poses, path, times, may_end_early=True)


def pair(estimate: Poses, truth: Poses, *, offset: float = 0.0) -> Paired:
    """Put an estimate and the ground truth on one clock.

    If the times of the two files do not fit, another unit (s, ms, us, ns) is tried for one of them;
    it is used if both then cover the same time.

    Parameters
    ----------
    estimate, truth
        From `read_estimate` and `read_truth`.
    offset
        Seconds that will be added to the times of the estimate.

    Raises
    ------
    DatasetError
        If it is not known which rows correspond; the message says what to give.
    """
    estimate, truth = _in_one_unit(estimate, truth, offset)
    return replace(_pair(estimate, truth), readings=(estimate.reading, truth.reading))


def _pair(estimate: Poses, truth: Poses) -> Paired:
    if not estimate.is_timed and _as_many(estimate.trajectory, truth.frame_times):
        estimate = replace(estimate, trajectory=_at(estimate, truth.frame_times), is_timed=True)
        by = "time: a row for every frame of the sequence"
        return Paired(estimate.trajectory, truth.trajectory, by, on_clocks=False)
    if estimate.is_timed and truth.is_timed:
        return Paired(estimate.trajectory, truth.trajectory, "time")
    if estimate.is_timed:
        return _by_frame_number(estimate, truth)
    if not truth.is_timed and len(estimate.trajectory) == len(truth.trajectory):
        by = "row: both files have a row for every frame"
        return Paired(estimate.trajectory, truth.trajectory, by, is_timed=False, on_clocks=False)
    raise DatasetError(
        f"{estimate.source} has {len(estimate.trajectory)} rows without time stamps, for "
        f"{_what_is_true(truth)}: which belong together is not known; compare trajectory.txt of "
        "the run, leave frames.csv of the run beside the file, or give the time of every row with "
        "--times"
    )


def _in_one_unit(estimate: Poses, truth: Poses, offset: float) -> tuple[Poses, Poses]:
    """Read the times of a file in another unit, if only this gives a common time."""
    if not (estimate.is_timed and truth.is_timed):
        return estimate, truth
    changed = _in_unit_of(estimate, truth.trajectory.timestamps - offset)
    if changed is not estimate:
        return changed, truth
    return estimate, _in_unit_of(truth, estimate.trajectory.timestamps + offset)


def _in_unit_of(poses: Poses, other: FloatArray) -> Poses:
    reading, path = poses.reading, poses.trajectory
    if reading.unit is None:
        return poses
    unit = unit_by_other(path.timestamps, reading.unit, other)
    if unit is reading.unit:
        return poses
    seconds = path.timestamps * reading.unit.per_second / unit.per_second
    kept = tuple(note for note in reading.notes if not note.startswith("times in"))
    note = f"times in {unit}, because these fit the times of the other file"
    return replace(
        poses,
        trajectory=Trajectory(seconds, path.T_wc, path.lost, path.indices),
        reading=replace(reading, unit=unit, notes=(note, *kept)),
    )


def rows_without_pose(T_wc: FloatArray) -> NDArray[np.bool_]:
    """Find rows in KITTI format for frames without a pose.

    Parameters
    ----------
    T_wc
        All rows of the file, float64 (n, 4, 4).

    Returns
    -------
    bool (n,)
        Rows that repeat the one before, and several identities at the beginning.
    """
    repeats = np.zeros(len(T_wc), bool)
    repeats[1:] = (T_wc[1:] == T_wc[:-1]).all(axis=(1, 2))
    if len(T_wc) > 1 and repeats[1] and (T_wc[0] == np.eye(4)).all():
        repeats[0] = True
    return repeats


def _before_the_map(T_wc: FloatArray) -> NDArray[np.bool_]:
    """Leading identities, except the last, which may be the first pose."""
    is_identity = (T_wc == np.eye(4)).all(axis=(1, 2))
    leading = np.logical_and.accumulate(is_identity)
    leading[max(0, int(leading.sum()) - 1) :] = False
    return leading


def _by_frame_number(estimate: Poses, truth: Poses) -> Paired:
    """Pair the frames of a run with the rows of a ground truth that has one for every frame."""
    frames, n = estimate.frames, len(truth.trajectory)
    if frames is None and estimate.frame_table is not None:
        frames = read_frame_table(estimate.frame_table)
    if frames is None or not _all_listed(estimate.trajectory, frames):
        raise DatasetError(
            f"{truth.source} has {n} poses without time stamps; give the time of each with "
            "--times, put times.txt beside it, or give the folder of the sequence instead"
        )
    last, step = _last_and_step(frames.indices)
    if not last + 1 - _end(last + 1) <= n <= last + step:
        raise DatasetError(
            f"{truth.source} has {n} poses without time stamps, but the run has ended with frame "
            f"{last} of its sequence: whether there is a pose for every frame is not known; give "
            "the time of each with --times, or the folder of the sequence instead"
        )
    known = frames.indices < n
    rows = Trajectory(frames.timestamps[known], truth.trajectory.T_wc[frames.indices[known]])
    by = "number of the frame, as in frames.csv"
    return Paired(estimate.trajectory, rows, by, on_clocks=False)


def _last_and_step(indices: IntArray) -> tuple[int, int]:
    steps = np.diff(indices)
    return int(indices.max()), int(max(1, steps.min())) if len(steps) else 1


def _all_listed(trajectory: Trajectory, frames: FrameTable) -> bool:
    """Return whether every time stamp is that of a frame of the run."""
    if not len(frames):
        return False
    ordered = np.sort(frames.timestamps)
    after = np.clip(np.searchsorted(ordered, trajectory.timestamps), 0, len(ordered) - 1)
    nearest = np.minimum(
        np.abs(ordered[after] - trajectory.timestamps),
        np.abs(ordered[np.maximum(after - 1, 0)] - trajectory.timestamps),
    )
    return bool((nearest < _SAME_TIME).all())


def _with_times(
    poses: Poses, path: Path, times: FloatArray | None, *, may_end_early: bool = False
) -> Poses:
    """Give the rows in KITTI format their times, if the numbers are equal."""
    if poses.is_timed:
        return poses
    for known in (times, _times_beside(path)):
        if _as_many(poses.trajectory, known) or (may_end_early and ends_early(poses, known)):
            trajectory = _at(poses, known)
            return replace(poses, trajectory=trajectory, is_timed=True, frame_times=known)
    return poses


def ends_early(poses: Poses, times: FloatArray | None) -> bool:
    """Return whether only a few frames at the end of a sequence have no true pose."""
    n = len(poses.trajectory)
    return times is not None and len(times) - _end(len(times)) <= n < len(times)


def _end(n: int) -> int:
    """Return how many frames at the end of a sequence may have no true pose."""
    return max(1, int(_END * n))


def _as_many(trajectory: Trajectory, times: FloatArray | None) -> bool:
    return times is not None and len(times) == len(trajectory)


def _at(poses: Poses, times: FloatArray | None) -> Trajectory:
    assert times is not None
    n = len(poses.trajectory)
    return Trajectory(times[:n], poses.trajectory.T_wc, poses.trajectory.lost)


def _times_beside(path: Path) -> FloatArray | None:
    benchmark = path.resolve().parent.parent / "sequences" / path.stem
    for folder in (path.parent, benchmark):
        if (folder / "times.txt").is_file():
            return read_times(folder / "times.txt")
    return None


def _what_is_true(truth: Poses) -> str:
    n = len(truth.trajectory)
    if truth.frame_times is not None:
        return f"a sequence of {len(truth.frame_times)} frames ({truth.source})"
    return f"{n} poses {'with' if truth.is_timed else 'without'} time stamps in {truth.source}"
