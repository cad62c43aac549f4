# SPDX-License-Identifier: BSD-3-Clause
"""Colours of map points by height, age, number of observations, or image."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._palette import KEYFRAME, POINTS, Colour
from orbslam2py.viewer.map_model import MapModel

#: How far the span of the values may grow or shrink before all points are coloured anew.
_TOLERANCE = 0.15
#: Points looked at to find that span.
_SAMPLE = 20_000
#: From which on more observations make no difference.
_MANY_OBSERVATIONS = 24.0


class ColourBy(str, Enum):
    """The meaning of the colour of a point."""

    IMAGE = "image"
    """The colour in the image."""
    HEIGHT = "height"
    """Its height: up direction of the first camera."""
    AGE = "age"
    """When it was made."""
    OBSERVATIONS = "observations"
    """Number of its observations."""
    MAP = "map"
    """Its map: the colour of the map's keyframes."""
    NOTHING = "nothing"
    """All alike."""

    def __str__(self) -> str:
        return self.value


class PointColours:
    """Colours the points of a map, page by page, by one scale for all.

    Parameters
    ----------
    model : MapModel
        The points.
    """

    def __init__(self, model: MapModel) -> None:
        self._model = model
        self.by = ColourBy.IMAGE
        #: Of the map, for those that are coloured by it.
        self.map_colour: Colour = KEYFRAME
        self._span = (0.0, 1.0)
        self._table = _colour_table()

    def update_span(self) -> bool:
        """Update the scale; True if all pages must be coloured again."""
        if self.by not in (ColourBy.HEIGHT, ColourBy.AGE):
            return False
        pages = list(self._model.points)
        if not pages:
            return False
        step = max(1, self._model.n_points // _SAMPLE)
        values = np.concatenate([self._values(number)[::step] for number in pages])
        if not len(values):
            return False
        low, high = np.percentile(values, [2, 98])
        width = max(high - low, 1e-9)
        off = max(abs(low - self._span[0]), abs(high - self._span[1]))
        if off <= _TOLERANCE * width:
            return False
        self._span = (float(low), float(low + width))
        return True

    def of_page(self, number: int) -> ByteArray:
        """Colours (p, 3) of the points of a page, red, green, blue."""
        if self.by is ColourBy.IMAGE:
            return self._model.colours_of(number, POINTS)
        values = self._values(number)
        if self.by in (ColourBy.NOTHING, ColourBy.MAP):
            colour = self.map_colour if self.by is ColourBy.MAP else POINTS
            return np.full((len(values), 3), colour, np.uint8)
        low, high = (np.log(2.0), np.log(_MANY_OBSERVATIONS)) if self._by_count else self._span
        place = np.clip((values - low) / (high - low), 0.0, 1.0)
        return np.asarray(self._table[(255 * place).astype(np.uint8)])

    @property
    def _by_count(self) -> bool:
        return self.by is ColourBy.OBSERVATIONS

    def _values(self, number: int) -> FloatArray:
        page = self._model.points[number]
        if self.by is ColourBy.HEIGHT:
            return -page.positions[:, 1].astype(np.float64)  # y is down
        if self._by_count:
            return np.asarray(np.log(np.maximum(page.observations, 1.0)), np.float64)
        return page.ids.astype(np.float64)


def _colour_table() -> ByteArray:
    """From dark blue over green to yellow (256, 3), for the colour-blind too (viridis)."""
    ramp = np.arange(256, dtype=np.uint8)[:, None]
    table = cv2.applyColorMap(ramp, cv2.COLORMAP_VIRIDIS)[:, 0, ::-1].astype(np.float64)
    # Its darkest colours are hard to see on a dark ground.
    return np.asarray(40 + table * (215 / 255), np.uint8)
