# SPDX-License-Identifier: BSD-3-Clause
"""Images of several cameras that belong to one moment."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

#: Images of one camera that wait for those of another one; the oldest is dropped then.
_MOST_WAITING = 8
#: Largest time between images of a pair that is not reported, seconds.
SAME_MOMENT = 1e-3


@dataclass(frozen=True)
class Part:
    """One image of a frame.

    Attributes
    ----------
    array
        The pixels.
    time
        When it was taken, seconds since 1970.
    stamp
        The same on the clock of the device, seconds.
    exposure, arrival
        Middle of the exposure, if it is known, and arrival, on the clock of ``time.monotonic()``.
    """

    array: NDArray[Any]
    time: float
    stamp: float
    exposure: float | None
    arrival: float


#: The images of one moment by stream.
Parts = dict[str, Part]


class Pairing:
    """Puts the images of several streams together by their times.

    Parameters
    ----------
    streams
        Names of the streams; the time of a frame is that of the first one.
    limit
        Largest time between the images of one moment, seconds.
    report
        Called with the kind and the end of a sentence when images are refused.
    """

    def __init__(
        self, streams: Sequence[str], limit: float, report: Callable[[str, str], None]
    ) -> None:
        self._waiting: dict[str, deque[Part]] = {stream: deque() for stream in streams}
        self._limit = limit
        self._report = report
        #: Time of the last image by stream, and the least time between two of one, seconds.
        self._newest: dict[str, float] = {}
        self._step = float("inf")
        #: Images by stream that were dropped because no other one belongs to them.
        self.n_alone = dict.fromkeys(streams, 0)
        #: Moments whose images were further apart than the limit.
        self.n_apart = 0
        #: Largest time between images that were paired, seconds.
        self.worst = 0.0

    def add(self, stream: str, part: Part) -> list[Parts]:
        """Take an image; return the frames that it completes, as a rule none or one."""
        queue = self._waiting[stream]
        if stream in self._newest:
            self._step = min(self._step, part.time - self._newest[stream])
        self._newest[stream] = part.time
        queue.append(part)
        complete = []
        while all(self._waiting.values()):
            heads = {name: waiting[0] for name, waiting in self._waiting.items()}
            first = min(heads, key=lambda name: heads[name].time)
            apart = max(head.time for head in heads.values()) - heads[first].time
            if apart <= self._limit:
                self._note(apart)
                complete.append({n: waiting.popleft() for n, waiting in self._waiting.items()})
            elif apart < self._step / 2:
                self._refuse(apart)
            else:
                self._drop_alone(first)
        if len(queue) > _MOST_WAITING:
            self._drop_alone(stream)
        return complete

    def silent(self) -> list[str]:
        """Name the streams that others wait for."""
        empty = [name for name, queue in self._waiting.items() if not queue]
        return empty if len(empty) < len(self._waiting) else []

    def clear(self) -> None:
        """Drop and count what waits: the device starts again."""
        self._newest = {}
        for stream, queue in self._waiting.items():
            while queue:
                self._drop(stream)

    def _drop(self, stream: str) -> None:
        self._waiting[stream].popleft()
        self.n_alone[stream] += 1

    def _note(self, apart: float) -> None:
        self.worst = max(self.worst, apart)
        if apart > SAME_MOMENT:
            self._report(
                "skew",
                f"takes the images of a pair {apart * 1e3:.1f} ms apart; synchronise the cameras",
            )

    def _refuse(self, apart: float) -> None:
        """Drop images that are nearest to each other, but no pair."""
        for stream in self._waiting:
            self._drop(stream)
        self.n_apart += 1
        self._report(
            "apart",
            f"has {' and '.join(self._waiting)} images {apart * 1e3:.1f} ms apart; the limit is "
            f"{self._limit * 1e3:.3g} ms: they are no pair and are dropped; synchronise the "
            "cameras",
        )

    def _drop_alone(self, stream: str) -> None:
        self._drop(stream)
        others = " or ".join(name for name in self._waiting if name != stream)
        self._report(
            "alone", f"sent no {others} image at the time of a {stream} image, which is dropped"
        )
