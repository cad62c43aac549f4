# SPDX-License-Identifier: BSD-3-Clause
"""The view of the browsers: free, or with the camera, from behind or from above."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from orbslam2py._arrays import FloatArray

if TYPE_CHECKING:
    import viser

_UP = np.array([0.0, -1.0, 0.0])  # that of the first camera
#: How far behind, in front and above, in half widths of a keyframe's frustum.
_BEHIND, _AHEAD, _RAISED, _ABOVE = 24.0, 14.0, 10.0, 110.0
#: Part of the way that the view turns to where the camera looks, with every image.
_TURN = 0.25


class Follow(str, Enum):
    """Mode of the view."""

    FREE = "free"
    """Controlled only by the mouse."""
    BEHIND = "from behind"
    ABOVE = "from above"

    def __str__(self) -> str:
        return self.value


class Follower:
    """Moves the views of all browsers with the camera.

    Attributes
    ----------
    mode : Follow
        The mode.
    distance : float
        Distance factor, 1 by default.
    """

    def __init__(self) -> None:
        self.mode = Follow.BEHIND
        self.distance = 1.0
        self._forward: FloatArray | None = None

    def move(self, client: viser.ClientHandle, T_wc: FloatArray, size: float) -> None:
        """Move the view of a browser to the camera.

        Parameters
        ----------
        client : viser.ClientHandle
            The browser.
        T_wc : array (4, 4)
            Camera to world.
        size : float
            Half the width of a keyframe's frustum.
        """
        if self.mode is Follow.FREE or size <= 0:
            return
        eye, target, up = self._view(T_wc, size)
        eye = target + self.distance * (eye - target)
        with client.atomic():
            client.camera.up_direction = up
            client.camera.position = eye
            client.camera.look_at = target

    def turn(self, T_wc: FloatArray) -> None:
        """Store the viewing direction of the camera, once for every image."""
        forward = T_wc[:3, 2]
        before = forward if self._forward is None else self._forward
        mixed = (1 - _TURN) * before + _TURN * forward
        length = float(np.linalg.norm(mixed))
        self._forward = mixed / length if length > 0.1 else forward

    def _view(self, T_wc: FloatArray, size: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position of the eye, target, and up direction."""
        place = T_wc[:3, 3]
        if self.mode is Follow.ABOVE:
            # Not quite from above, where left and right would have no meaning.
            return place + size * _ABOVE * (_UP - [0, 0, 0.02]), place, np.array([0.0, 0.0, 1.0])
        forward = T_wc[:3, 2] if self._forward is None else self._forward
        eye = place - size * _BEHIND * forward + size * _RAISED * _UP
        upright = abs(float(forward @ _UP)) < 0.95
        return eye, place + size * _AHEAD * forward, _UP if upright else -T_wc[:3, 1]


def whole_view(
    points: FloatArray, beside: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return a view of the whole map: eye and target, from its points (n, 3).

    Further points (m, 3) are also visible.
    """
    low, high = np.percentile(points, [2, 98], axis=0)
    if beside is not None and len(beside):
        low, high = np.minimum(low, beside.min(axis=0)), np.maximum(high, beside.max(axis=0))
    target = (low + high) / 2
    breadth = max(float(np.linalg.norm(high - low)), 1e-3)
    away = np.array([0.35, -0.75, -0.55])
    return target + 1.05 * breadth * away / np.linalg.norm(away), target
