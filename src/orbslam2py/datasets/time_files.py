# SPDX-License-Identifier: BSD-3-Clause
"""Time stamps for images without any: from a rate, or from a text file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import TextLine, content_lines
from orbslam2py.datasets.base import Stamps
from orbslam2py.datasets.clock import is_time, read_clock, time_of, value_of
from orbslam2py.errors import DatasetError

#: Digits of a whole number that is a time since 1970, and its decimals of a second.
_PARTS_OF_SECOND = {19: 9, 16: 6, 13: 3}

#: Fields of a line: time; time and file; the same of two cameras.
_FIELDS = {1, 2, 4}


def stamps_of_rate(n: int, fps: float) -> Stamps:
    """Make time stamps from 0 at a constant rate.

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


def stamps_of_names(files: list[Path]) -> Stamps | None:
    """Use the names of images as their times, if all are times and increase.

    Parameters
    ----------
    files
        Images in their order.

    Returns
    -------
    Stamps or None
        None if a name is neither decimal seconds nor a whole number of milli-, micro- or
        nanoseconds since 1970, or if they do not increase.
    """
    texts = [seconds_of_name(path.stem) for path in files]
    if None in texts:
        return None
    seconds = np.array([float(text) for text in texts if text is not None])
    if (np.diff(seconds) <= 0).any():
        return None
    return Stamps(seconds, tuple(text for text in texts if text is not None), ())


def seconds_of_name(stem: str) -> str | None:
    """Return the time in a name, in seconds; None if it is no time."""
    if re.fullmatch(r"\d+\.\d+", stem):
        return stem
    if not (re.fullmatch(r"[0-9]+", stem) and len(stem) in _PARTS_OF_SECOND):
        return None
    digits = _PARTS_OF_SECOND[len(stem)]
    return f"{stem[:-digits]}.{stem[-digits:]}"


def read_time_file(
    path: Path, n: int, names: Sequence[str] | None = None, fps: float | None = None
) -> Stamps:
    """Read one time stamp per image: seconds, milli-, micro- or nanoseconds, or dates.

    The unit is that which fits the frame rate; see `orbslam2py.datasets.clock`. Empty lines and
    lines starting with ``#`` are left out.

    Lists with the images' files in the second field are also read, such as ``rgb.txt`` and
    associations of TUM RGB-D, or EuRoC's ``data.csv``. Then lines are assigned by file names,
    without folders; other lines are ignored.

    Parameters
    ----------
    path
        The file.
    n
        Number of images.
    names
        Names of their files; None if they have none (a video).
    fps
        Images per second by the settings, if they are known.

    Raises
    ------
    DatasetError
        If the file cannot be read or does not contain `n` increasing numbers.
    """
    lines = _uniform_lines(path)
    if names is not None and lines and len(lines[0].fields) > 1:
        lines = _lines_of(path, lines, names)
    for line in lines:
        time_of(path, line, line.fields[0])
    if len(lines) != n:
        raise DatasetError(
            f"{path} holds {len(lines)} time stamps, but there are {n} images; give one for each"
        )
    texts = [line.fields[0] for line in lines]
    values = [value_of(path, text) for text in texts]
    for i, (earlier, later) in enumerate(pairwise(values)):
        if later <= earlier:
            raise DatasetError(
                f"{path}:{lines[i + 1].number}: time stamp {texts[i + 1]} is not after the one "
                f"before it, {texts[i]}; time must grow from image to image"
            )
    return read_clock(path, texts, fps).stamps([line.number for line in lines])


def _uniform_lines(path: Path) -> list[TextLine]:
    """Split into fields, at commas if there are any, and check that all lines have as many."""
    lines = content_lines(path)
    if any("," in field for line in lines for field in line.fields):
        lines = content_lines(path, separator=",")
    lines = [_with_date_joined(line) for line in lines]
    if len(lines) > 1 and not any(map(is_time, lines[0].fields)):
        lines = _as_the_head_says(lines[0], lines[1:])
    counts = {len(line.fields) for line in lines}
    if len(counts) > 1 or not counts <= _FIELDS:
        odd = next(line for line in lines if len(line.fields) != 1)
        raise DatasetError(
            f"{path}:{odd.number}: expected one time stamp, or a time stamp and an image file in "
            f"every line, found {len(odd.fields)} fields"
        )
    return lines


def _as_the_head_says(head: TextLine, lines: list[TextLine]) -> list[TextLine]:
    """Choose time and file by the names of the columns; all columns if no name means a time."""
    names = [name.lower() for name in head.fields]
    time = next((k for k, name in enumerate(names) if "time" in name or "stamp" in name), None)
    if time is None or any(len(line.fields) != len(names) for line in lines):
        return [head, *lines]
    file = [k for k, name in enumerate(names) if "file" in name or "path" in name]
    return [TextLine(one.number, [one.fields[k] for k in (time, *file[:1])]) for one in lines]


def _with_date_joined(line: TextLine) -> TextLine:
    """Join the two parts of a date that begins a line."""
    joined = " ".join(line.fields[:2])
    if len(line.fields) > 1 and is_time(joined):
        return TextLine(line.number, [joined, *line.fields[2:]])
    return line


def _lines_of(path: Path, lines: list[TextLine], names: Sequence[str]) -> list[TextLine]:
    """Choose the line of each image by the name of its file."""
    by_name = {Path(line.fields[1]).name: line for line in reversed(lines)}
    missing = [name for name in names if name not in by_name]
    if missing:
        raise DatasetError(
            f"{path} has no time stamp for {len(missing)} of {len(names)} images, the first is "
            f"{missing[0]}; give a list of all images, or a file with nothing but time stamps"
        )
    return [by_name[name] for name in names]
