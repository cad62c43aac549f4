# SPDX-License-Identifier: BSD-3-Clause
"""For how long tracking has been lost; ``docs/method/several_maps.md#being-lost``."""

from __future__ import annotations

import math


class LostTimer:
    """Tells by time stamps when a loss has lasted so long that another map may begin.

    Parameters
    ----------
    patience : float or None
        Seconds; None: for ever.
    """

    def __init__(self, patience: float | None) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        """Nothing is lost."""
        self._lost_since: float | None = None
        self._followed_since: float | None = None

    def lost(self, timestamp: float) -> None:
        """Note a frame without a pose."""
        self._followed_since = None
        if self._lost_since is None:
            self._lost_since = timestamp

    def followed(self, timestamp: float) -> None:
        """Note a frame with a pose; found for a moment only, the camera is as lost as before."""
        if self._lost_since is None:
            return
        if self._followed_since is None:
            self._followed_since = timestamp
        if timestamp - self._followed_since >= (self._patience or 0.0):
            self.reset()

    def be_overdue(self) -> None:
        """Let the next image begin a map if it can."""
        self._lost_since = -math.inf

    def overdue(self, timestamp: float) -> bool:
        """Whether tracking has been lost for longer than the patience."""
        if self._patience is None or self._lost_since is None:
            return False
        return timestamp - self._lost_since >= self._patience
