# SPDX-License-Identifier: BSD-3-Clause
"""Whether a source delivers as many frames per second as expected."""

from __future__ import annotations

#: Seconds over which frames are counted.
_WINDOW = 3.0
#: Part of the expected rate below which it has fallen, and from which it is as expected again.
_FALLEN, _RECOVERED = 0.7, 0.85


class RateWatch:
    """Counts the frames of a time window, and reports when their rate falls or recovers.

    Parameters
    ----------
    expected
        Frames per second.
    """

    def __init__(self, expected: float) -> None:
        self._expected = expected
        self._begin: float | None = None
        self._n = 0
        self._low = False
        #: Windows with a low rate, and the lowest rate, frames per second.
        self.n_low = 0
        self.lowest: float | None = None

    def restart(self) -> None:
        """Begin a new window with the next frame."""
        self._begin = None

    def add(self, now: float) -> str | None:
        """Count a frame that came at `now` [s]; return the end of a sentence about a change."""
        if self._begin is None:
            self._begin, self._n = now, 0
            return None
        self._n += 1
        if now - self._begin < _WINDOW:
            return None
        rate = self._n / (now - self._begin)
        self._begin, self._n = now, 0
        if rate < _FALLEN * self._expected:
            self.n_low += 1
            self.lowest = rate if self.lowest is None else min(rate, self.lowest)
            if not self._low:
                self._low = True
                return (
                    f"delivers {rate:.1f} frames per second; the settings say "
                    f"{self._expected:g} (Camera.fps). In dim light cameras expose longer; a slow "
                    "USB port or network drops images"
                )
        elif self._low and rate > _RECOVERED * self._expected:
            self._low = False
            return f"delivers {rate:.1f} frames per second again"
        return None
