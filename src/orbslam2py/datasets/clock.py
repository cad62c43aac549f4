# SPDX-License-Identifier: BSD-3-Clause
"""Time stamps of a list as users write them: their unit, their order, and equal ones.

One mechanism serves all lists of images. It reports its changes in a warning.
"""

from __future__ import annotations

import bisect
import logging
import math
import re
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from pathlib import Path

import numpy as np

from orbslam2py._text_lines import TextLine
from orbslam2py.datasets.base import Stamps
from orbslam2py.errors import DatasetError

_log = logging.getLogger(__name__)

_NANO = 10**9
#: Units by the digits of a second that they count, and their names.
_UNITS = {0: "seconds", 3: "milliseconds", 6: "microseconds", 9: "nanoseconds"}
#: Times since 1970 are at least this large in milli-, micro- and nanoseconds.
_SINCE_1970 = {9: 10**17, 6: 10**14, 3: 10**11}
#: Steps up to this multiple of the frame's duration are seconds: images may have been left out.
_MOST_FRAMES_LEFT_OUT = 300
#: Steps below this share of the frame's duration contradict the frame rate.
_LEAST_STEP = 1 / 20
#: Longest step of seconds where no frame rate is known [s].
_LONGEST_STEP = 300
#: If more than one line in this number is out of order, the clock may have been set back.
_ORDERLY = 10
_DATE = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[ T](\d\d):(\d\d):(\d\d)(?:[.,](\d+))?(?:Z|\+00:?00)?", re.ASCII
)


@dataclass(frozen=True)
class Clock:
    """Times of a list.

    Attributes
    ----------
    order
        Line numbers of the list, in the order of time.
    nanoseconds
        Time of each, growing.
    texts
        The same as text in seconds; unchanged times keep the text of the source.
    doubts
        Changes and doubts, one sentence each. All were logged.
    """

    order: tuple[int, ...]
    nanoseconds: tuple[int, ...]
    texts: tuple[str, ...]
    doubts: tuple[str, ...]

    def stamps(self, lines: Sequence[int] = ()) -> Stamps:
        """Return the times as stamps.

        Parameters
        ----------
        lines
            Line number of each place in the list.
        """
        seconds = np.array([float(text) for text in self.texts], dtype=np.float64)
        numbers = tuple(lines[place] for place in self.order) if lines else ()
        return Stamps(seconds, self.texts, numbers, self.doubts)


def read_clock(
    source: Path | str, texts: Sequence[str], fps: float | None, *, usual_unit: int = 0
) -> Clock:
    """Interpret the times of a list.

    Parameters
    ----------
    source
        The list, for warnings.
    texts
        Times in the order of the list: numbers or dates (``2011-09-26 13:02:25.964389445``).
    fps
        Images per second by the settings, if they are known.
    usual_unit
        Usual digits of a second in such lists, for which there is no note: 9 for nanoseconds.

    Raises
    ------
    DatasetError
        If a text is no time.
    """
    doubts: list[str] = []
    values = [value_of(source, text) for text in texts]
    digits = 0 if any(map(_is_date, texts)) else unit_of(values, fps)
    if digits != usual_unit and not any(map(_is_date, texts)):
        taken = f"{source}: the time stamps are taken for {_UNITS[digits]}"
        if _is_since_1970(values):
            _log.info("%s", taken)  # which leaves no doubt
        else:
            doubts.append(taken)
    nanoseconds = [int((value * 10 ** (9 - digits)).to_integral_value()) for value in values]
    doubts += _doubts_of_rate(source, nanoseconds, fps)
    order = list(range(len(texts)))
    if any(later < earlier for earlier, later in pairwise(nanoseconds)):
        if was_set_back(nanoseconds):
            nanoseconds = _continued(source, nanoseconds, doubts)
        else:
            doubts.append(f"{source}: the lines are not in the order of time; they are sorted")
            order.sort(key=lambda place: nanoseconds[place])  # stable: equal ones keep their order
    in_order = [nanoseconds[place] for place in order]
    spread = _spread(source, in_order, fps, doubts)
    written = []
    for place, time in zip(order, spread, strict=True):
        is_kept = digits == 0 and Decimal(time) == values[place] * _NANO
        written.append(texts[place] if is_kept and not _is_date(texts[place]) else text_of(time))
    for doubt in doubts:
        _log.warning("%s", doubt)
    return Clock(tuple(order), tuple(spread), tuple(written), tuple(doubts))


def text_of(nanoseconds: int) -> str:
    """Write nanoseconds as decimal seconds."""
    sign = "-" if nanoseconds < 0 else ""
    whole, rest = divmod(abs(nanoseconds), _NANO)
    return f"{sign}{whole}.{rest:09d}"


def is_time(text: str) -> bool:
    """Return whether a text is a number or a date."""
    try:
        value_of("", text)
    except DatasetError:
        return False
    return True


def time_of(path: Path, line: TextLine, text: str) -> Decimal:
    """Convert a time of a list.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    return value_of(f"{path}:{line.number}", text)


def value_of(source: Path | str, text: str) -> Decimal:
    """Convert a number or a date; dates become seconds since 1970.

    Raises
    ------
    DatasetError
        If it is neither.
    """
    date = _DATE.fullmatch(text)
    if date is not None:
        *parts, fraction = date.groups()
        try:
            whole = datetime(*map(int, parts), tzinfo=timezone.utc)  # type: ignore[misc,arg-type]
        except ValueError as error:
            raise DatasetError(f"{source}: {text} is no date ({error}); correct it") from None
        return Decimal(int(whole.timestamp())) + Decimal(f"0.{fraction or 0}")
    try:
        value = Decimal(text)
    except InvalidOperation:
        raise DatasetError(f"{source}: '{text}' is not a number; correct it") from None
    if not value.is_finite():
        raise DatasetError(f"{source}: {text} is not finite; correct it, or leave out the line")
    return value


def unit_of(values: Sequence[Decimal], fps: float | None) -> int:
    """Return the digits of a second of the unit: 0 for seconds, 9 for nanoseconds.

    The unit is chosen so that the usual step agrees with the frame rate. Images may be missing:
    long steps count as seconds unless another unit fits far better.
    """
    largest = _largest(values)
    for digits, least in _SINCE_1970.items():
        if largest >= least:
            return digits
    steps = [abs(later - earlier) for earlier, later in pairwise(values) if later != earlier]
    if not steps:
        return 0
    step = float(statistics.median(steps))
    if fps is None:
        return 0 if step <= _LONGEST_STEP else min(9, 3 * math.ceil(math.log10(step) / 3))
    if step * fps <= _MOST_FRAMES_LEFT_OUT:
        return 0
    return min(_UNITS, key=lambda digits: abs(math.log(step * fps / 10**digits)))


def _largest(values: Sequence[Decimal]) -> Decimal:
    return max((abs(value) for value in values), default=Decimal(0))


def _is_since_1970(values: Sequence[Decimal]) -> bool:
    return _largest(values) >= min(_SINCE_1970.values())


def was_set_back(times: Sequence[int]) -> bool:
    """Return whether a clock was set back: increasing times with a few jumps back.

    A list with a few misplaced lines, or without any order, is unordered instead.
    """
    n = len(times)
    back = sum(later < earlier for earlier, later in pairwise(times))
    few = max(1, n // _ORDERLY)
    return 0 < back <= few and n - _longest_rise(times) > few


def _longest_rise(times: Sequence[int]) -> int:
    """Return the length of the longest subsequence that does not decrease."""
    ends: list[int] = []
    for time in times:
        place = bisect.bisect_right(ends, time)
        ends[place : place + 1] = [time]
    return len(ends)


def _continued(source: Path | str, times: Sequence[int], doubts: list[str]) -> list[int]:
    """Move the times after each jump back of the clock."""
    step = _usual_step(times)
    continued, shift = [times[0]], 0
    for place, (earlier, later) in enumerate(pairwise(times)):
        if later < earlier:
            back = earlier - later + step
            shift += back
            doubts.append(
                f"{source}: the clock was set back by some {back / _NANO:.6g} s after image "
                f"{place}; the order of the list is kept, and the later times are moved"
            )
        continued.append(later + shift)
    return continued


def _usual_step(times: Sequence[int]) -> int:
    steps = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    return int(statistics.median(steps)) if steps else _NANO // 30


def _spread(
    source: Path | str, times: Sequence[int], fps: float | None, doubts: list[str]
) -> list[int]:
    """Distribute images of equal times up to the next time."""
    groups: list[tuple[int, int]] = []  # first place, number of images
    for place, time in enumerate(times):
        if groups and times[groups[-1][0]] == time:
            groups[-1] = (groups[-1][0], groups[-1][1] + 1)
        else:
            groups.append((place, 1))
    n_equal = sum(count for _, count in groups if count > 1)
    if not n_equal:
        return list(times)
    frame = _NANO / fps if fps else _usual_step(times) / statistics.median(c for _, c in groups)
    doubts.append(
        f"{source}: {n_equal} images have the time stamp of another one; they are spread over the "
        "time until the next"
    )
    spread: list[int] = []
    for (place, count), following in zip(groups, [*groups[1:], None], strict=True):
        room = count * frame
        if following is not None:
            room = min(room, times[following[0]] - times[place])
        spread += [times[place] + int(room * k / count) for k in range(count)]
    return spread


def _doubts_of_rate(source: Path | str, times: Sequence[int], fps: float | None) -> list[str]:
    steps = [abs(later - earlier) for earlier, later in pairwise(times) if later != earlier]
    if fps is None or not steps:
        return []
    step = statistics.median(steps) / _NANO
    if _LEAST_STEP <= step * fps <= _MOST_FRAMES_LEFT_OUT:
        return []
    return [
        f"{source}: the images are {step:.3g} s apart, but Camera.fps of the settings is {fps:g}; "
        "correct one of them"
    ]


def _is_date(text: str) -> bool:
    return _DATE.fullmatch(text) is not None
