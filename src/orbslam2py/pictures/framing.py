# SPDX-License-Identifier: BSD-3-Clause
"""The visible part of a plane: a window that follows a growing box smoothly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray

#: Distance of the drawn objects from the border, relative to the window.
_MARGIN = 0.04
#: A new window has room for later positions.
_HEADROOM = 1.3
#: A window this much too large is made smaller.
_TOO_LARGE = 2.6
#: How fast a window moves to where it is to be [1/s].
_SPEED = 3.5
#: The smallest window shows so much [world's unit].
_SMALLEST = 0.2


@dataclass(frozen=True)
class Framing:
    """A window on the plane that moves to its target.

    Its state is (x and y of its centre, logarithm of the length of a pixel).
    """

    state: FloatArray
    """(3,)"""
    speed: FloatArray
    """(3,) change of the state per second."""
    goal: FloatArray
    """(3,) the target of the state."""
    size: tuple[int, int]
    """Width and height of the picture [px]."""

    @property
    def unit_per_pixel(self) -> float:
        """Length of a pixel in the plane."""
        return float(np.exp(self.state[2]))

    def to_pixels(self, places: npt.NDArray[np.floating]) -> FloatArray:
        """Return pixels (..., 2) of points (..., 2) in the plane, whose y axis goes up."""
        middle = 0.5 * (np.array(self.size) - 1)
        scale = np.array([1.0, -1.0]) / self.unit_per_pixel
        return np.asarray((places - self.state[:2]) * scale + middle)

    def shows(self, low: FloatArray, high: FloatArray, state: FloatArray | None = None) -> bool:
        """Return whether a box of the plane is inside, and not too small."""
        x, y, log_scale = self.state if state is None else state
        half = 0.5 * np.array(self.size) * np.exp(log_scale)
        inside = np.abs(np.stack([low, high]) - (x, y)).max(axis=0) <= (1 - 2 * _MARGIN) * half
        fitting = _fit(low, high, self.size)[2]
        return bool(inside.all() and log_scale - fitting < np.log(_TOO_LARGE))

    def follow(self, low: FloatArray, high: FloatArray, seconds: float) -> Framing:
        """Move for some time, so that a box of the plane stays visible.

        The motion is that of a critically damped spring: it begins and ends smoothly.

        Parameters
        ----------
        low, high : array of float64, (2,)
            Corners of the visible box.
        seconds : float
            Time that passes.
        """
        goal = self.goal
        if not self.shows(low, high, goal):
            goal = _fit(low, high, self.size, _HEADROOM)
        off = self.state - goal
        decay = np.exp(-_SPEED * seconds)
        pull = self.speed + _SPEED * off
        unit = np.array([*(2 * [self.unit_per_pixel]), 1.0 / max(self.size)])
        if (np.abs(off) + np.abs(self.speed) < 0.2 * unit).all():  # the rest is not visible
            return replace(self, state=goal, speed=np.zeros(3), goal=goal)
        return replace(
            self,
            state=goal + (off + pull * seconds) * decay,
            speed=(self.speed - _SPEED * pull * seconds) * decay,
            goal=goal,
        )


def frame_all(low: FloatArray, high: FloatArray, size: tuple[int, int]) -> Framing:
    """Make a window that shows a box of the plane, with a margin.

    Parameters
    ----------
    low, high : array of float64, (2,)
        Corners of the visible box.
    size : (int, int)
        Width and height of the picture [px].
    """
    state = _fit(low, high, size, _HEADROOM)
    return Framing(state=state, speed=np.zeros(3), goal=state, size=size)


def _fit(
    low: FloatArray, high: FloatArray, size: tuple[int, int], headroom: float = 1.0
) -> FloatArray:
    extent = np.maximum(high - low, _SMALLEST) / (1 - 2 * _MARGIN)
    middle = 0.5 * (low + high)
    return np.array([middle[0], middle[1], np.log(headroom * (extent / size).max())])
