# SPDX-License-Identifier: BSD-3-Clause
"""Positions and times in a map, in the form of the command line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, numbers_of
from orbslam2py.errors import MapFileError
from orbslam2py.maps import MapContents
from orbslam2py.maps.content_groups import BoolArray

_LINE_OF_TIME, _LINE_OF_POSITION = 4, 6


def keyframes_between(contents: MapContents, begin: float | None, end: float | None) -> BoolArray:
    """Return which keyframes, bool (k,), were made between ``--from`` and ``--to``.

    Parameters
    ----------
    contents
        The map.
    begin, end
        Seconds since its first keyframe; None: its beginning or end.

    Raises
    ------
    MapFileError
        If there are none; the message names these options.
    """
    for option, seconds in (("--from", begin), ("--to", end)):
        if seconds is not None and math.isnan(seconds):
            raise MapFileError(f"{option} is nan; give seconds since the first keyframe")
    least, most = -math.inf if begin is None else begin, math.inf if end is None else end
    if least > most:
        raise MapFileError(f"--from {begin:g} is later than --to {end:g}; give the earlier first")
    times = contents.keyframes.timestamps
    first = times.min()
    kept = (times >= first + least) & (times <= first + most)
    if not kept.any():
        since = np.sort(times - first)
        around = [*since[since <= least][-1:], *since[since >= most][:1]]
        raise MapFileError(
            f"nothing of the map is left: no keyframe is of{_span(begin, end)} s after the first "
            f"one; the nearest {'is' if len(around) == 1 else 'are'} of "
            f"{' and '.join(f'{seconds:.3f}' for seconds in around)} s"
        )
    return np.asarray(kept)


def _span(begin: float | None, end: float | None) -> str:
    words = [] if begin is None else [f" --from {begin:g}"]
    return "".join([*words, *([] if end is None else [f" --to {end:g}"])])


def read_position(option: str, text: str) -> FloatArray:
    """Read ``1.5,0,-2``.

    Raises
    ------
    MapFileError
        If it is anything else.
    """
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise MapFileError(f"{option} is '{text}'; give a position like 1.5,0,-2")
    return numbers


def read_place(contents: MapContents, text: str) -> FloatArray:
    """Read a position in the map, or the position of the camera at a time.

    Raises
    ------
    MapFileError
        If it is neither, or the time is not in the map.
    """
    if "," in text:
        return read_position("--between", text)
    try:
        seconds = float(text)
    except ValueError:
        raise MapFileError(
            f"--between has '{text}'; give places like 1.5,0,-2 or seconds like 12.4"
        ) from None
    return _camera_at(contents, seconds)


def _camera_at(contents: MapContents, seconds: float) -> FloatArray:
    """Return the position of the camera, from the keyframes before and after."""
    times = contents.keyframes.timestamps
    order = np.argsort(times, kind="stable")
    since = times[order] - times[order[0]]
    if not 0 <= seconds <= since[-1]:
        raise MapFileError(
            f"{seconds:g} s is not within the map, whose keyframes are of 0 to {since[-1]:g} s"
        )
    centres = contents.keyframes.T_wc[order, :3, 3]
    return np.array([np.interp(seconds, since, centres[:, axis]) for axis in range(3)])


def read_known_points(path: Path, contents: MapContents) -> tuple[FloatArray, FloatArray]:
    """Read points known in the map and in the world, (m, 3) each.

    Raises
    ------
    DatasetError, MapFileError
        Naming file and line.
    """
    in_map, in_world = [], []
    for line in content_lines(path):
        numbers = numbers_of(path, line, (_LINE_OF_TIME, _LINE_OF_POSITION))
        if len(numbers) == _LINE_OF_TIME:
            in_map.append(_camera_at(contents, numbers[0]))
        else:
            in_map.append(np.array(numbers[:3]))
        in_world.append(np.array(numbers[-3:]))
    return np.array(in_map).reshape(-1, 3), np.array(in_world).reshape(-1, 3)
