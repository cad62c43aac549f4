# SPDX-License-Identifier: BSD-3-Clause
"""Image, map and time line side by side in one picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import ByteArray
from orbslam2py._palette import GROUND
from orbslam2py.pictures.overlay import fit_size, status_height

#: Images wider than this, relative to their height, stand above the time line.
_WIDE = 2.0


@dataclass(frozen=True)
class Box:
    """A part of a picture [px]."""

    x: int
    y: int
    width: int
    height: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    def put(self, picture: ByteArray, part: ByteArray) -> None:
        """Copy a part of this size to its position."""
        picture[self.y : self.y + self.height, self.x : self.x + self.width] = part


@dataclass(frozen=True)
class Composition:
    """The layout of a picture."""

    size: tuple[int, int]
    """Width and height of the whole picture [px]."""
    image: Box
    status: Box
    map: Box
    time_line: Box
    text: int
    """Height of the letters [px]."""

    def ground(self) -> ByteArray:
        """An empty picture, (h, w, 3)."""
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        picture[:] = GROUND
        return picture


def compose(image_size: tuple[int, int], size: tuple[int, int]) -> Composition:
    """Find places for everything.

    Parameters
    ----------
    image_size : (int, int)
        Width and height of the camera's images [px], of any ratio.
    size : (int, int)
        Width and height of the whole picture [px].
    """
    width, height = size
    text = max(10, round(height / 48))
    gap = max(4, round(height / 90))
    if image_size[0] > _WIDE * image_size[1]:
        return _with_wide_image(image_size, size, text, gap)
    line_height = round(0.16 * height)
    upper = height - line_height - 3 * gap
    room = (round(0.60 * width), upper - status_height(round(0.56 * width)))
    shown = fit_size(image_size, room)
    column = max(shown[0], round(0.38 * width))
    status = status_height(column)
    shown = fit_size(image_size, (column, upper - status))
    image = Box(gap + (column - shown[0]) // 2, gap + (upper - status - shown[1]) // 2, *shown)
    right = column + 2 * gap
    return Composition(
        size,
        image,
        Box(gap, gap + upper - status, column, status),
        Box(right, gap, width - gap - right, upper),
        Box(gap, 2 * gap + upper, width - 2 * gap, line_height),
        text,
    )


def _with_wide_image(
    image_size: tuple[int, int], size: tuple[int, int], text: int, gap: int
) -> Composition:
    """A column of image, status and time line; the map beside it has the full height."""
    width, height = size
    column = round(0.62 * width)
    status = status_height(column)
    shown = fit_size(image_size, (column, round(0.6 * height)))
    right = column + 2 * gap
    below = gap + shown[1] + status + gap
    return Composition(
        size,
        Box(gap + (column - shown[0]) // 2, gap, *shown),
        Box(gap, gap + shown[1], column, status),
        Box(right, gap, width - gap - right, height - 2 * gap),
        Box(gap, below, column, height - gap - below),
        text,
    )
