# SPDX-License-Identifier: BSD-3-Clause
"""A made-up font of a few letters."""

from __future__ import annotations

from pathlib import Path

from fontTools.fontBuilder import FontBuilder
from fontTools.pens.ttGlyphPen import TTGlyphPen

_UNITS = 1000


def write_font(path: Path, letters: str, weight: int = 400) -> Path:
    """Write a font in which each of the letters is a black square; 500 is a bit heavier text."""
    pen = TTGlyphPen(None)
    pen.moveTo((50, 0))
    for corner in ((50, 900), (950, 900), (950, 0)):
        pen.lineTo(corner)
    pen.closePath()
    square, nothing = pen.glyph(), TTGlyphPen(None).glyph()
    names = {ord(letter): f"square{number}" for number, letter in enumerate(letters)}
    order = [".notdef", *names.values()]
    made = FontBuilder(_UNITS, isTTF=True)
    made.setupGlyphOrder(order)
    made.setupCharacterMap(names)
    made.setupGlyf({name: nothing if name == ".notdef" else square for name in order})
    made.setupHorizontalMetrics(dict.fromkeys(order, (_UNITS, 50)))
    made.setupHorizontalHeader(ascent=900, descent=-100)
    made.setupNameTable({"familyName": "Made Up", "styleName": "Regular"})
    made.setupOS2(sTypoAscender=900, sTypoDescender=-100, usWeightClass=weight)
    made.setupPost()
    made.save(str(path))
    return path
