# SPDX-License-Identifier: BSD-3-Clause
"""Times of the images of a topic, and pairs of images by time."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.bag import Bag, Message, Topic
from orbslam2py.datasets.bags.messages import HEAD_SIZE, read_head
from orbslam2py.datasets.base import Stamps
from orbslam2py.datasets.clock import was_set_back
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory import MAX_DIFFERENCE, associate

_log = logging.getLogger(__name__)

_NANO = 10**9
#: A step longer than this multiple of the usual one, and than this duration [s], is a gap.
_GAP, _SHORTEST_GAP = 5.0, 0.5
#: Largest time between images of a pair that is not reported [s].
_SAME_MOMENT = 1e-3


@dataclass(frozen=True)
class TimedMessages:
    """The images of a topic in the order of their times.

    Attributes
    ----------
    nanoseconds
        When each was taken.
    messages
        Positions of the messages.
    sizes
        Number of images of each size; empty if they are compressed.
    frame
        Frame id of the camera.
    """

    nanoseconds: list[int]
    messages: list[Message]
    sizes: dict[tuple[int, int], int]
    frame: str

    @property
    def seconds(self) -> FloatArray:
        """Return times relative to the first image [s]: small numbers keep all digits."""
        first = self.nanoseconds[0] if self.nanoseconds else 0
        return np.array([stamp - first for stamp in self.nanoseconds], dtype=np.int64) / 1e9

    def since(self, other: TimedMessages) -> FloatArray:
        """Return times relative to the first image of another topic [s]."""
        return self.seconds + (self.nanoseconds[0] - other.nanoseconds[0]) / 1e9


def time_messages(bag: Bag, topic: Topic) -> TimedMessages:
    """Read the headers of the images of a topic, and sort the images by their stamps.

    Without stamps of the driver, the times of recording are used. Of images with equal stamps the
    first is used.

    Raises
    ------
    DatasetError
        If no image is left.
    """
    found: list[tuple[int, Message]] = []
    sizes: dict[tuple[int, int], int] = {}
    frame, damaged = "", 0
    for message in bag.messages(topic):
        try:
            head = read_head(bag.read(message, HEAD_SIZE), topic.kind, topic.encoding)
        except DatasetError:
            damaged += 1
            continue
        found.append((head.stamp, message))
        frame = frame or head.frame
        if head.size is not None:
            sizes[head.size] = sizes.get(head.size, 0) + 1
    if damaged:
        _log.warning("%s: %d messages of %s are damaged, left out", bag.path, damaged, topic.name)
    if not found:
        raise DatasetError(f"{bag.path} has no image of {topic.name} that can be read")
    if len(found) > 1 and len({stamp for stamp, _ in found}) == 1:
        _log.warning(
            "%s: all images of %s have the same stamp; the times of recording are taken",
            *(bag.path, topic.name),
        )
        found = [(message.recorded, message) for _, message in found]
    if was_set_back([stamp for stamp, _ in found]):
        _log.warning(
            "%s: the clock of %s was set back while it recorded; the times of recording are taken",
            *(bag.path, topic.name),
        )
        found = [(message.recorded, message) for _, message in found]
    by_stamp: dict[int, Message] = {}
    for stamp, message in sorted(found):
        by_stamp.setdefault(stamp, message)
    if len(by_stamp) < len(found):
        _log.warning(
            "%s: %d images of %s have the stamp of another one, left out",
            *(bag.path, len(found) - len(by_stamp), topic.name),
        )
    return TimedMessages(list(by_stamp), list(by_stamp.values()), sizes, frame)


def require_one_size(path: Path, topic: Topic, sizes: dict[tuple[int, int], int]) -> None:
    """Raise `DatasetError` if the images of a topic have several sizes."""
    if len(sizes) <= 1:
        return
    listed = ", ".join(f"{n} of {w} x {h}" for (w, h), n in sorted(sizes.items(), reverse=True))
    raise DatasetError(
        f"{path}: images of {topic.name} have {len(sizes)} sizes ({listed}); a run needs images of "
        "one size: cut the bag where the size changes"
    )


def pair_messages(
    path: Path, first: TimedMessages, second: TimedMessages, names: tuple[str, str]
) -> tuple[list[int], list[int]]:
    """Pair the images of two topics by their times.

    Parameters
    ----------
    path
        The bag, for messages.
    first, second
        The images; as many as possible of the first topic get an image of the second.
    names
        Names of the two topics.

    Returns
    -------
    first_indices, second_indices
        Pairs of images in the order of time.

    Raises
    ------
    DatasetError
        If none do.
    """
    step = np.median(np.diff(first.seconds)) if len(first.messages) > 1 else 2 * MAX_DIFFERENCE
    limit = min(MAX_DIFFERENCE, max(float(step) / 2, _SAME_MOMENT))
    i, j = associate(first.seconds, second.since(first), limit)
    if not len(i):
        apart = (second.nanoseconds[0] - first.nanoseconds[0]) / _NANO
        raise DatasetError(
            f"{path}: no image of {names[0]} was taken within {limit * 1e3:.3g} ms of one of "
            f"{names[1]} (the first ones are {apart:.3f} s apart); synchronise the cameras"
        )
    alone = len(first.messages) - len(i)
    if alone:
        _log.warning("%s: %d images of %s have none of %s, left out", path, alone, *names)
    worst = float(np.abs(first.seconds[i] - second.since(first)[j]).max())
    if worst > _SAME_MOMENT:
        _log.warning(
            "%s: images of %s and %s that are paired were taken up to %.1f ms apart",
            *(path, *names, worst * 1e3),
        )
    return i.tolist(), j.tolist()


def stamps_of(nanoseconds: list[int]) -> Stamps:
    """Make stamps of whole nanoseconds."""
    texts = tuple(f"{stamp // _NANO}.{stamp % _NANO:09d}" for stamp in nanoseconds)
    return Stamps(np.array([float(text) for text in texts], dtype=np.float64), texts, ())


def warn_of_gaps(path: Path, seconds: FloatArray) -> None:
    """Log long gaps between images."""
    steps = np.diff(seconds)
    if len(steps) < 2:
        return
    gaps = np.flatnonzero(steps > max(_GAP * float(np.median(steps)), _SHORTEST_GAP))
    if len(gaps):
        longest = int(gaps[np.argmax(steps[gaps])])
        _log.warning(
            "%s: images are missing in %d places; the longest gap is %.1f s after frame %d",
            *(path, len(gaps), steps[longest], longest),
        )
