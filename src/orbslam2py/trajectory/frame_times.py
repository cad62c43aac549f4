# SPDX-License-Identifier: BSD-3-Clause
"""Times of the frames of a sequence: lists of times, and the frames of a run."""

from __future__ import annotations

import csv
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import cannot_open, path_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.errors import DatasetError

#: Whole numbers are nanoseconds if their typical step is longer than this as seconds (a day), or if
#: one is later than this (the year 5138, counted from 1970).
_LONGEST_STEP, _LATEST = 86400, 10**17


#: What the table of a run's frames begins with, in this version and in others.
FRAME_COLUMNS = ("index", "timestamp", "map", "state", "reason")


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


def is_frame_table(path: Path) -> bool:
    """Return whether a file is the table of a run's frames."""
    beginning = ",".join(FRAME_COLUMNS).encode()
    try:
        with path.open("rb") as file:
            return file.read(len(beginning)) == beginning
    except OSError:
        return False


def read_frame_table(path: str | Path) -> FrameTable:
    """Read ``frames.csv`` of a run.

    Raises
    ------
    DatasetError
        If the file cannot be read, or is no such table; the message names the line.
    """
    rows = []
    try:
        # Reasons hold names of files byte by byte, and not all names are UTF-8.
        with path_of(path, "the table of frames").open(
            encoding="utf-8", errors="replace", newline=""
        ) as stream:
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
            "move the file away, or write it again with orbslam2py run"
        ) from None
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    last = table[:, 2].max(initial=0)
    return FrameTable(
        table[:, 0].astype(np.int64), table[:, 1], (table[:, 3] > 0) & (table[:, 2] == last)
    )


def in_seconds(texts: Sequence[str]) -> list[str]:
    """Write whole nanoseconds as decimal seconds, with all their digits; others do not change.

    Parameters
    ----------
    texts
        Return the times of a list, finite numbers. They count as nanoseconds if all are whole and
        impossible as seconds: steps of more than a day, or as large as nanoseconds since 1970.
    """
    if not all(text.isdecimal() for text in texts):
        return list(texts)
    times = [int(text) for text in texts]
    steps = [later - earlier for earlier, later in pairwise(times)]
    if max(times, default=0) < _LATEST and (not steps or statistics.median(steps) <= _LONGEST_STEP):
        return list(texts)
    return [f"{time // 10**9}.{time % 10**9:09d}" for time in times]


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
        number_of(path, line, line.fields[0])
    texts = in_seconds([line.fields[0] for line in lines])
    times = np.array([float(text) for text in texts], np.float64)
    back = np.flatnonzero(np.diff(times) < 0)
    if len(back):
        raise DatasetError(
            f"{path}:{lines[int(back[0]) + 1].number}: the time stamp is before the one above it; "
            "give the times in the order of the frames"
        )
    return times
