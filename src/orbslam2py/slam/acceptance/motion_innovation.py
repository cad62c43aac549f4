# SPDX-License-Identifier: BSD-3-Clause
"""How a camera usually changes its motion; ``docs/method/tracking.md#evidence``."""

from __future__ import annotations

import math

from orbslam2py._arrays import FloatArray
from orbslam2py.slam.config import AcceptanceConfig


class MotionInnovation:
    """How far poses usually lie from where the motion before them led.

    A change is the tangent (6,), rotation [rad] and translation, from a frame's pose to the one
    that the motion led to. Turns and ways are weighed apart: their units differ.

    Parameters
    ----------
    config : AcceptanceConfig
        Limits.
    """

    def __init__(self, config: AcceptanceConfig) -> None:
        self._limits = config
        self._turn = 0.0
        self._way = 0.0
        self._n_seen = 0

    @property
    def is_known(self) -> bool:
        """Whether enough was seen to tell what is usual."""
        return self._n_seen >= self._limits.changes_seen

    def beyond(self, change: FloatArray) -> FloatArray | None:
        """The part (6,) of a change that is beyond the usual; None where there is none.

        The share is that of the turn or of the way, whichever exceeds its usual by more: a turn
        that is a mistake is paid for by a way that is one.

        Parameters
        ----------
        change : array of float64, (6,)
            The frame's.
        """
        limits = self._limits
        if not self.is_known:
            return None
        turn, way = _squares(change)
        least = min(_by(self._turn, turn), _by(self._way, way))
        share = 1.0 - limits.usual_changes * math.sqrt(least)
        return None if share <= 0 else share * change

    def see(self, change: FloatArray) -> None:
        """Let a frame that is believed move what is usual; a sudden change moves it little.

        Parameters
        ----------
        change : array of float64, (6,)
            The frame's.
        """
        turn, way = _squares(change)
        # After complete rest nothing is usual: several times nothing would stay so for ever.
        most = self._limits.sudden_change**2
        turn = min(turn, most * self._turn) if self._turn > 0 else turn
        way = min(way, most * self._way) if self._way > 0 else way
        gain = max(self._limits.gain, 1.0 / (self._n_seen + 1))
        self._turn += gain * (turn - self._turn)
        self._way += gain * (way - self._way)
        self._n_seen += 1


def _squares(change: FloatArray) -> tuple[float, float]:
    # Six numbers, in every frame: faster without NumPy.
    a, b, c, x, y, z = change.tolist()
    return a * a + b * b + c * c, x * x + y * y + z * z


def _by(usual: float, now: float) -> float:
    """The usual square by this one's; infinite for none, which is never unusual."""
    return usual / now if now > 0 else math.inf
