# SPDX-License-Identifier: BSD-3-Clause
"""The states of the images over time, as a picture. Plain arrays in."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._palette import (
    FAINT_TEXT,
    FRAME,
    KEYFRAME,
    LOOP,
    LOST,
    NOW,
    PANEL,
    TEXT,
    Colour,
)
from orbslam2py.pictures.lettering import draw_text, text_width
from orbslam2py.pictures.overlay import state_colour
from orbslam2py.slam.records import TrackingRecord, TrackingState

_SHIFT = 4
#: State of an image that was not used, beside those of `TrackingState`.
NOT_USED = -2
#: State of an image that was tracked by visual odometry, outside of the map.
WANDERING = -3
#: Lines of text for which there must be room to draw two curves.
_ROOM_FOR_TWO = 8
_INLIERS: Colour = (196, 206, 218)
_MILLISECONDS: Colour = (168, 150, 205)


def _no_times() -> FloatArray:
    return np.zeros(0)


@dataclass(frozen=True)
class History:
    """The states of the images so far."""

    seconds: FloatArray = field(default_factory=_no_times)
    """(n,) since the first image of the recording, ascending."""
    states: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(n,) `TrackingState`, `NOT_USED` or `WANDERING`."""
    inliers: FloatArray = field(default_factory=_no_times)
    """(n,) numbers of inliers of the poses."""
    milliseconds: FloatArray = field(default_factory=_no_times)
    """(n,) that tracking took."""
    keyframes: FloatArray = field(default_factory=_no_times)
    """(k,) seconds of the keyframes."""
    loops: FloatArray = field(default_factory=_no_times)
    """(l,) seconds of the loop closures."""
    duration: float | None = None
    """Length of the whole recording in seconds; None if unknown."""


class GrowingHistory:
    """Collects a `History`, image by image.

    Parameters
    ----------
    duration : float, optional
        Seconds of the whole recording.
    """

    def __init__(self, duration: float | None = None) -> None:
        self._duration = duration
        self._begin: float | None = None
        self._n = 0
        self._rows = np.zeros((256, 5))
        self._loops: list[float] = []

    def add(self, record: TrackingRecord, *, wanders: bool = False) -> None:
        """Add an image that was processed by tracking."""
        state = WANDERING if wanders else int(record.state)
        took = record.milliseconds.get("track", 0.0)
        self._append(record.timestamp, state, record.n_inliers, took, record.is_keyframe)

    def add_unused(self, timestamp: float) -> None:
        """Add an image that was not used."""
        self._append(timestamp, NOT_USED, 0, 0.0, False)

    def add_loop(self, timestamp: float) -> None:
        """Add a loop that was closed at the image of a time [s]."""
        self._loops.append(timestamp)

    def picture(self) -> History:
        """Return the history so far."""
        seconds, states, inliers, milliseconds, is_keyframe = self._rows[: self._n].T
        begin = self._begin or 0.0
        return History(
            seconds=seconds.copy(),
            states=states.astype(np.int64),
            inliers=inliers.copy(),
            milliseconds=milliseconds.copy(),
            keyframes=seconds[is_keyframe > 0],
            loops=np.array(self._loops) - begin,
            duration=self._duration,
        )

    def _append(
        self,
        timestamp: float,
        state: int,
        n_inliers: int,
        milliseconds: float,
        is_keyframe: bool,
    ) -> None:
        if self._begin is None:
            self._begin = timestamp
        if self._n == len(self._rows):
            self._rows = np.pad(self._rows, ((0, self._n), (0, 0)))
        self._rows[self._n] = (
            timestamp - self._begin,
            state,
            n_inliers,
            milliseconds,
            is_keyframe,
        )
        self._n += 1


def draw_time_line(history: History, size: tuple[int, int], *, text: int = 14) -> ByteArray:
    """Draw the tracking state, keyframes, loops and inliers over time.

    Parameters
    ----------
    history : History
        The recorded history.
    size : (int, int)
        Width and height [px].
    text : int
        Height of the letters [px].

    Returns
    -------
    array of uint8, (h, w, 3)
        Red, green, blue.
    """
    width, height = size
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = PANEL
    now = float(history.seconds[-1]) if len(history.seconds) else 0.0
    duration = max(history.duration or 0.0, now, 1e-9)
    left = min(text_width("keyframes", text) + text, width // 2)
    axis = _Axis(left, max(left + 2, width - text), duration)
    letter = 0.9 * text
    strip = (round(0.7 * text), round(0.7 * text + letter))
    ticks = (strip[1] + text // 3, strip[1] + text // 3 + round(letter))
    lowest = height - round(1.9 * text)
    curves = [("inliers", history.inliers, _INLIERS)]
    if lowest - ticks[1] > _ROOM_FOR_TWO * text:
        curves.append(("ms", history.milliseconds, _MILLISECONDS))
    edges = np.linspace(ticks[1] + text // 3, lowest, len(curves) + 1).round().astype(int).tolist()
    _draw_states(picture, history, axis, strip)
    _draw_ticks(picture, history.keyframes, axis, ticks)
    rows = [("state", strip), ("keyframes", ticks)]
    for i, (name, values, colour) in enumerate(curves):
        curve = (edges[i] + (text // 2 if i else 0), edges[i + 1])
        rows.append((name, curve))
        if curve[1] - curve[0] > 4:
            _draw_curve(picture, history.seconds, values, colour, axis, curve, text)
    for name, ends in rows:
        place = (left - text // 2, sum(ends) // 2)
        draw_text(picture, name, place, text, FAINT_TEXT, anchor="right")
    _draw_loops(picture, history.loops, axis, (strip[0], lowest), text)
    _draw_seconds(picture, now, duration, axis, height - round(0.85 * text), text)
    x = axis.pixel(now)
    picture[max(0, strip[0] - text // 3) : lowest + 2, x : x + max(2, text // 7)] = NOW
    return picture


@dataclass(frozen=True)
class _Axis:
    left: int
    right: int
    duration: float

    def pixels(self, seconds: FloatArray) -> npt.NDArray[np.int64]:
        along = np.clip(seconds / self.duration, 0.0, 1.0)
        return np.rint(self.left + along * (self.right - 1 - self.left)).astype(np.int64)

    def pixel(self, seconds: float) -> int:
        return int(self.pixels(np.array([seconds]))[0])


def _draw_states(picture: ByteArray, history: History, axis: _Axis, rows: tuple[int, int]) -> None:
    columns = np.empty((axis.right - axis.left, 3), np.uint8)
    columns[:] = FRAME
    part = picture[rows[0] : rows[1], axis.left : axis.right]
    if not len(history.seconds):
        part[:] = columns
        return
    # An image stands for the time until the next one, the last for none after it.
    begins = axis.pixels(history.seconds) - axis.left
    which = np.searchsorted(begins, np.arange(begins[-1] + 1), side="right") - 1
    # Where several images share a column, a bad one is not to be hidden by the good.
    worst = np.full(len(columns), -1)
    known = np.arange(begins[0], begins[-1] + 1)
    worst[known] = which[known]
    for state in (TrackingState.NOT_INITIALIZED, NOT_USED, TrackingState.LOST):
        bad = np.flatnonzero(history.states == state)
        worst[begins[bad]] = bad
    seen = worst >= 0
    colours = np.array([_colour_of(int(state)) for state in _STATES], np.uint8)
    index = np.searchsorted(_STATES, history.states[worst[seen]])
    columns[seen] = colours[index]
    part[:] = columns
    # Losses are hatched as well, for those who do not see their colour.
    is_lost = np.zeros(len(columns), bool)
    is_lost[seen] = history.states[worst[seen]] == TrackingState.LOST
    y, x = np.mgrid[: part.shape[0], : part.shape[1]]
    part[is_lost & ((x + y) % 6 < 2)] = tuple(channel // 3 for channel in LOST)


_STATES = np.array(sorted({WANDERING, NOT_USED, *(int(state) for state in TrackingState)}))


def _colour_of(state: int) -> Colour:
    if state == WANDERING:
        return state_colour(TrackingState.OK, visual_odometry=True)
    if state == NOT_USED:
        return state_colour(TrackingState.OK, skipped=True)
    return state_colour(TrackingState(state))


def _draw_ticks(
    picture: ByteArray, seconds: FloatArray, axis: _Axis, rows: tuple[int, int]
) -> None:
    picture[rows[1] : rows[1] + 1, axis.left : axis.right] = FRAME
    picture[rows[0] : rows[1], axis.pixels(seconds)] = KEYFRAME


def _draw_curve(
    picture: ByteArray,
    seconds: FloatArray,
    values: FloatArray,
    colour: Colour,
    axis: _Axis,
    rows: tuple[int, int],
    text: int,
) -> None:
    picture[rows[1] : rows[1] + 1, axis.left : axis.right] = FRAME
    top = _round_up(float(values.max(initial=1.0)))
    if len(seconds):
        x = axis.pixels(seconds).astype(np.float64)
        y = rows[1] - values / top * (rows[1] - rows[0])
        line = np.stack([x, y], axis=1)
        area = np.concatenate([line, [(x[-1], rows[1]), (x[0], rows[1])]])
        _fill(picture, area, tuple(channel // 3 for channel in colour))
        whole = np.rint(line * (1 << _SHIFT)).astype(np.int32)
        cv2.polylines(picture, [whole], False, colour, max(1, text // 9), cv2.LINE_AA, _SHIFT)
    place = (axis.right, rows[0] + text // 3)
    draw_text(picture, f"{top:.0f}", place, max(9, text - 3), FAINT_TEXT, anchor="right")


def _fill(picture: ByteArray, corners: FloatArray, colour: tuple[int, ...]) -> None:
    whole = np.rint(corners * (1 << _SHIFT)).astype(np.int32)
    cv2.fillPoly(picture, [whole], colour, cv2.LINE_AA, _SHIFT)


def _round_up(number: float) -> float:
    """Return the next of 50, 100, 200, 500 ..., so that the axis rarely changes."""
    power = 10.0 ** np.floor(np.log10(max(number, 10.0)))
    return float(min(f * power for f in (1, 2, 5, 10) if f * power >= number))


def _draw_loops(
    picture: ByteArray, seconds: FloatArray, axis: _Axis, rows: tuple[int, int], text: int
) -> None:
    half = max(4, round(0.4 * text))
    diamond = np.array([(0, -half), (half, 0), (0, half), (-half, 0)])
    for x in axis.pixels(seconds).tolist():
        picture[rows[0] : rows[1], x : x + max(1, text // 9)] = LOOP
        _fill(picture, diamond + np.array([x, rows[0] + half // 2], np.float64), LOOP)
    if len(seconds):
        x = axis.pixel(float(seconds[-1]))
        side = "left" if x < axis.right - 5 * text else "right"
        place = (x + (text if side == "left" else -text), rows[1] - round(0.7 * text))
        draw_text(picture, "loop", place, text, LOOP, anchor="left" if side == "left" else "right")


def _draw_seconds(
    picture: ByteArray, now: float, duration: float, axis: _Axis, y: int, text: int
) -> None:
    whole = f"{duration:.1f} s"
    said = f"{now:.1f} s"
    half = text_width(said, text) // 2
    if now >= duration:  # they are the same
        draw_text(picture, whole, (axis.right, y), text, TEXT, anchor="right")
        return
    last = axis.right - text_width(whole, text) - text - half
    x = min(max(axis.pixel(now), axis.left + half), max(last, axis.left + half))
    draw_text(picture, whole, (axis.right, y), text, FAINT_TEXT, anchor="right")
    draw_text(picture, said, (x, y), text, TEXT, anchor="centre")
