# SPDX-License-Identifier: BSD-3-Clause
"""Text in pictures: each text is drawn once, then copied from memory.

Pillow draws DejaVu's letters, which come with Matplotlib: OpenCV's own are hard to read when small,
and only ASCII.
"""

from __future__ import annotations

import importlib.resources
import math
from functools import lru_cache
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from orbslam2py._arrays import ByteArray
from orbslam2py._palette import TEXT, Colour

#: Where a text lies beside the place it is drawn at.
Anchor = Literal["left", "centre", "right"]


def text_width(text: str, size: int, *, bold: bool = False) -> int:
    """Width of a line of text [px].

    Parameters
    ----------
    text : str
        One line.
    size : int
        Height of the letters from top to bottom [px].
    bold : bool
        Heavier letters.
    """
    return int(_letters(text, size, bold).shape[1])


def draw_text(
    picture: ByteArray,
    text: str,
    place: tuple[int, int],
    size: int,
    colour: Colour = TEXT,
    *,
    bold: bool = False,
    anchor: Anchor = "left",
) -> None:
    """Write a line of text into a picture; parts outside are cut off.

    Parameters
    ----------
    picture : array of uint8, (h, w, 3)
        Changed.
    text : str
        One line.
    place : (int, int)
        x of the beginning, middle or end of the text, y of the middle of its height [px].
    size : int
        Height of the letters from top to bottom [px].
    colour : (int, int, int)
        In the order of the picture's channels.
    bold : bool
        Heavier letters.
    anchor : str
        Position of `place` in the text: left, centre or right.
    """
    letters = _letters(text, size, bold)
    h, w = letters.shape
    x = place[0] - {"left": 0, "centre": w // 2, "right": w}[anchor]
    y = place[1] - h // 2
    left, top = max(0, -x), max(0, -y)
    right, bottom = min(w, picture.shape[1] - x), min(h, picture.shape[0] - y)
    if left >= right or top >= bottom:
        return
    part = picture[y + top : y + bottom, x + left : x + right]
    cover = letters[top:bottom, left:right, None].astype(np.uint16)
    shade = part * (255 - cover) + np.array(colour, np.uint16) * cover
    part[:] = (shade + 127) // 255


@lru_cache(maxsize=512)
def _letters(text: str, size: int, bold: bool) -> ByteArray:
    """Return the coverage of each pixel by the text (h, w), 0 to 255."""
    font = _font(size, bold)
    left, _, right, _ = font.getbbox(text, anchor="ls")
    left = min(0, math.floor(left))
    height = round(1.3 * size)
    page = Image.new("L", (max(1, math.ceil(right) - left), height))
    baseline = round(0.5 * height + 0.36 * size)
    ImageDraw.Draw(page).text((-left, baseline), text, fill=255, font=font, anchor="ls")
    return np.asarray(page)


@lru_cache(maxsize=32)
def _font(size: int, bold: bool) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    folder = importlib.resources.files("matplotlib") / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(str(folder / name), size)
