# SPDX-License-Identifier: BSD-3-Clause
"""When the frames of a sequence were taken: lists of times, and the frames of a run."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import cannot_open, path_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.errors import DatasetError

_LONGEST_STEP = 86400  # whole numbers are nanoseconds if they step by more than that as seconds


@dataclass(frozen=True, eq=False)
class FrameTable:
    """The frames of a run, as ``frames.csv`` lists them.

    Attributes
    ----------
    indices
        Number of every frame in its sequence, from 0, int64 (n,).
    timestamps
        Seconds, float64 (n,).
    has_pose
        Which of them have a pose in the last map, bool (n,).
    """

    indices: IntArray
    timestamps: FloatArray
    has_pose: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.indices)


def read_frame_table(path: str | Path) -> FrameTable:
    """Read ``frames.csv`` of a run.

    Raises
    ------
    DatasetError
        If the file cannot be read, or is not one of these: naming the line.
    """
    rows = []
    try:
        with path_of(path, "the table of frames").open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream)
            for row in reader:
                world = int(row["map"]) if row["map"] else -1
                timestamp = float(row["timestamp"])
                rows.append((int(row["index"]), timestamp, world, row["state"] == "OK"))
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    except (KeyError, TypeError, ValueError, csv.Error):
        raise DatasetError(
            f"{path}:{len(rows) + 2}: no row of a run's frames (index, timestamp, map, state); "
            "move the file away, or write it anew with orbslam2py run"
        ) from None
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    last = table[:, 2].max(initial=0)
    return FrameTable(
        table[:, 0].astype(np.int64), table[:, 1], (table[:, 3] > 0) & (table[:, 2] == last)
    )


def read_times(path: str | Path) -> FloatArray:
    """Read one time stamp per line: decimal seconds, or whole nanoseconds.

    Parameters
    ----------
    path
        The file; empty lines and lines starting with ``#`` are left out.

    Returns
    -------
    FloatArray
        Seconds, (n,), not decreasing.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    lines = content_lines(path)
    for line in lines:
        if len(line.fields) != 1:
            raise DatasetError(
                f"{path}:{line.number}: expected one time stamp, found {len(line.fields)} fields; "
                "a list of times has one per line"
            )
    times = np.array([number_of(path, line, line.fields[0]) for line in lines], np.float64)
    back = np.flatnonzero(np.diff(times) < 0)
    if len(back):
        raise DatasetError(
            f"{path}:{lines[int(back[0]) + 1].number}: the time stamp is before the one above it; "
            "give the times in the order of the frames"
        )
    whole = all(line.fields[0].isdecimal() for line in lines)
    if whole and len(times) > 1 and np.median(np.diff(times)) > _LONGEST_STEP:
        times = np.array([int(line.fields[0]) / 1e9 for line in lines])
    return times
