# SPDX-License-Identifier: BSD-3-Clause
"""Stamps of images as their publisher wrote them, by the times that the system uses."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Any

from orbslam2py.datasets.base import LiveFrame, LiveSource
from orbslam2py.live.device import Device

#: Images whose stamps are kept: keyframes of a long run ask for old ones.
_MOST = 200_000
_NANO = 10**9


class StampedSource:
    """A live source that notes the stamp of each frame; all else is the source's.

    Parameters
    ----------
    source
        The frames.
    """

    def __init__(self, source: LiveSource) -> None:
        self._source = source
        self._stamps: OrderedDict[float, int] = OrderedDict()
        exact = getattr(device_of(source), "nanoseconds_of", None)
        self._nanoseconds_of: Callable[[float], int] = exact or nanoseconds

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    def __enter__(self) -> StampedSource:
        self._source.__enter__()
        return self

    def __exit__(self, *details: object) -> None:
        self._source.__exit__(*details)

    def __iter__(self) -> Iterator[LiveFrame]:
        """Yield the frames of the source."""
        for frame in self._source:
            yield self._noted(frame)

    def take(self, timeout: float, /) -> LiveFrame | None:
        """Take a frame of the source; see `LiveSource.take`."""
        frame = self._source.take(timeout)
        return None if frame is None else self._noted(frame)

    def stamp_of(self, timestamp: float) -> int:
        """Return the stamp [ns] of the image of a time of the system [s]."""
        return self._stamps.get(timestamp, nanoseconds(timestamp))

    def _noted(self, frame: LiveFrame) -> LiveFrame:
        if frame.stamp is not None:
            self._stamps[frame.timestamp] = self._nanoseconds_of(frame.stamp)
            if len(self._stamps) > _MOST:
                self._stamps.popitem(last=False)
        return frame


def nanoseconds(seconds: float) -> int:
    """Return a time in nanoseconds."""
    return round(seconds * _NANO)


def device_of(source: object) -> Device | None:
    """Return the device behind a source; None if there is none."""
    return getattr(source, "device", None)
