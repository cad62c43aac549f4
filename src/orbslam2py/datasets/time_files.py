# SPDX-License-Identifier: BSD-3-Clause
"""Time stamps of images that carry none: from a rate, or from a text file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.datasets.base import Stamps
from orbslam2py.errors import DatasetError

#: Whole numbers are nanoseconds if their typical step is longer than this as seconds (a day).
_LONGEST_STEP = 86400


def stamps_of_rate(n: int, fps: float) -> Stamps:
    """Make time stamps from 0 on at a constant rate.

    Parameters
    ----------
    n
        Number of images.
    fps
        Images per second, above 0.
    """
    seconds = np.arange(n, dtype=np.float64) / fps
    return stamps_of_seconds(seconds)


def stamps_of_seconds(seconds: FloatArray) -> Stamps:
    """Make time stamps of float64 (n,) seconds, written with nine decimals."""
    return Stamps(seconds, tuple(f"{time:.9f}" for time in seconds.tolist()), ())


def read_time_file(path: Path, n: int) -> Stamps:
    """Read one time stamp per image: decimal seconds, or whole nanoseconds.

    A file of whole numbers holds nanoseconds if its typical step would be more than a day in
    seconds. Empty lines and lines starting with ``#`` are left out.

    Parameters
    ----------
    path
        The file.
    n
        Number of images.

    Raises
    ------
    DatasetError
        If the file cannot be read or does not hold `n` increasing numbers.
    """
    lines = content_lines(path)
    for line in lines:
        if len(line.fields) != 1:
            raise DatasetError(
                f"{path}:{line.number}: expected one time stamp, found {len(line.fields)} fields"
            )
    texts = [line.fields[0] for line in lines]
    seconds = np.array([number_of(path, line, line.fields[0]) for line in lines])
    if len(lines) != n:
        raise DatasetError(f"{path} holds {len(lines)} time stamps, but there are {n} images")
    whole = [int(text) for text in texts if text.isdecimal()]
    if len(whole) == n > 1 and np.median(np.diff(whole)) > _LONGEST_STEP:
        texts = [f"{time // 10**9}.{time % 10**9:09d}" for time in whole]
        seconds = np.array([time / 1e9 for time in whole])
    for i in np.flatnonzero(np.diff(seconds) <= 0).tolist():
        raise DatasetError(
            f"{path}:{lines[i + 1].number}: time stamp {texts[i + 1]} is not after the one before "
            f"it, {texts[i]}; time must grow from image to image"
        )
    return Stamps(seconds, tuple(texts), tuple(line.number for line in lines))
