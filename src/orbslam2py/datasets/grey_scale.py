# SPDX-License-Identifier: BSD-3-Clause
"""Images of 16 bits in a sequence: distinguished from depth, and scaled by a common range."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray
from orbslam2py._sixteen_bits import LINE_OF_PYTHON, N_SAMPLE, GreyRange, range_of
from orbslam2py.datasets.images import read_any
from orbslam2py.errors import DatasetError, ImageError, OrbSlamError

_log = logging.getLogger(__name__)

#: Share of zeros from which on images of 16 bits may be depth, which has 0 where it is unknown.
_MANY_ZEROS = 0.05


class GreyScale:
    """Scales the images of 16 bits of one sequence to 8 bits, all by the same range.

    The range is chosen at the first of them, from images distributed over the sequence. One note
    reports it. May be called from several threads.

    Parameters
    ----------
    what
        The sequence, for messages.
    sample
        Reads some images, distributed over the sequence.
    """

    def __init__(self, what: object, sample: Callable[[], Iterable[NDArray[np.generic]]]) -> None:
        self._what = what
        self._sample = sample
        self._range: GreyRange | None = None
        self._lock = threading.Lock()

    def __call__(self, image: NDArray[np.generic], what: object = None) -> ByteArray:
        """Scale an image of uint16 to uint8; `what` is its file, which is not read."""
        with self._lock:
            if self._range is None:
                self._range = self._choose(image)
        return self._range.to_8_bits(image)

    def _choose(self, image: NDArray[np.generic]) -> GreyRange:
        images = [one for one in self._sample() if one.dtype == np.uint16] or [image]
        chosen = range_of(images)
        _log.info(
            "%s: images of 16 bits; in all images, grey values %s become 0 to 255 (the range of %d "
            "sample images)",
            *(self._what, chosen, len(images)),
        )
        zeros = float(np.mean([np.mean(np.asarray(one) == 0) for one in images]))
        if zeros > _MANY_ZEROS:
            _log.warning(
                "%s: %.0f %% of the pixels are 0, as in depth images; if these are depth images, "
                "give the images of the camera instead",
                *(self._what, 100 * zeros),
            )
        return chosen


def spread_over(n: int) -> list[int]:
    """Numbers of the sample in a sequence of `n` images, ascending."""
    places = np.linspace(0, n - 1, min(n, N_SAMPLE))
    return [int(place) for place in np.unique(places.round())]


def read_sample(files: Iterable[Path]) -> list[NDArray[np.generic]]:
    """Read images unchanged; unreadable ones are left out."""
    found = []
    for path in files:
        try:
            found.append(read_any(path))
        except OrbSlamError:  # said when the run comes to it
            continue
    return found


def refuse_depth(path: Path, image: NDArray[np.generic], *, with_depth: bool) -> None:
    """Raise `ImageError` if an image that should be grey or colour is a depth image.

    Parameters
    ----------
    path
        Its file, whose name or folder may say depth.
    image
        The image as read.
    with_depth
        Whether there is a separate depth image: then 16 bits in one channel are never grey.
    """
    if image.dtype != np.uint16 or (image.ndim == 3 and image.shape[2] > 1):
        return
    named = "depth" in path.name.lower() or "depth" in path.parent.name.lower()
    if not (with_depth or named):
        return
    remedy = "Give the colour or grey images of the camera there, 8 bits per channel"
    if with_depth:
        remedy += f"; of grey images of 16 bits make 8 bits first: {LINE_OF_PYTHON}"
    raise ImageError(
        f"{path} looks like a depth image (16 bits, one channel), where an image of the camera "
        f"is needed: are images and depth exchanged? {remedy}"
    )


def refuse_first_depth(path: Path, *, with_depth: bool) -> None:
    """Check the first image of a sequence; see `refuse_depth`.

    Raises
    ------
    DatasetError
        If it is a depth image.
    """
    for image in read_sample([path]):
        try:
            refuse_depth(path, image, with_depth=with_depth)
        except ImageError as error:
            raise DatasetError(str(error)) from error
