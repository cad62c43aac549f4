# SPDX-License-Identifier: BSD-3-Clause
"""Grey values of 16 bits to 8 bits, by one range for all images of a sequence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray

#: Images that a range is taken from, spread over the sequence.
N_SAMPLE = 16
#: Percentiles that become black and white: a few hot or dead pixels must not set the range.
_DARKEST, _BRIGHTEST = 0.1, 99.9
#: Share of the newest image in a range that follows the images: a few seconds long.
_FOLLOWING = 0.02
#: The line of Python that does it, for messages.
LINE_OF_PYTHON = (
    "image = ((np.clip(image, low, high) - low) * (255 / (high - low))).astype('uint8')"
)
#: What to do about 16 bits where no range can be known, for messages.
REMEDY = f"scale them to 8 bits with the same low and high for all images: {LINE_OF_PYTHON}"


@dataclass(frozen=True)
class GreyRange:
    """The grey values of 16 bits that become black (0) and white (255).

    Attributes
    ----------
    low, high
        Grey values; `high` is above `low`.
    """

    low: float
    high: float

    @cached_property
    def _table(self) -> ByteArray:
        values = (np.arange(1 << 16, dtype=np.float64) - self.low) * (255 / (self.high - self.low))
        return np.clip(np.round(values), 0, 255).astype(np.uint8)

    def to_8_bits(self, image: NDArray[np.generic]) -> ByteArray:
        """Scale an image of uint16 (any shape) to uint8 of the same shape."""
        scaled: ByteArray = self._table[image]
        return scaled

    def __str__(self) -> str:
        return f"{self.low:.0f} to {self.high:.0f}"


def range_of(images: Iterable[NDArray[np.generic]]) -> GreyRange:
    """Choose one range for all images by the percentiles of a sample of uint16 images."""
    counts = np.zeros(1 << 16, dtype=np.int64)
    for image in images:
        counts += np.bincount(np.asarray(image).reshape(-1), minlength=1 << 16)
    below = np.cumsum(counts)
    low, high = (
        float(np.searchsorted(below, below[-1] * percent / 100, side="right"))
        for percent in (_DARKEST, _BRIGHTEST)
    )
    low, high = min(low, 65534.0), min(high, 65535.0)
    return GreyRange(low, max(high, low + 1))


class FollowingRange:
    """A range for consecutive images, which it follows slowly."""

    def __init__(self) -> None:
        self._range: GreyRange | None = None

    def to_8_bits(self, image: NDArray[np.generic]) -> ByteArray:
        """Scale an image of uint16 to uint8; the first image determines the range."""
        new = range_of([image])
        if self._range is not None:
            old = self._range
            low, high = (
                (1 - _FOLLOWING) * before + _FOLLOWING * now
                for before, now in ((old.low, new.low), (old.high, new.high))
            )
            new = GreyRange(low, high)
        self._range = new
        return new.to_8_bits(image)
