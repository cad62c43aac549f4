# SPDX-License-Identifier: BSD-3-Clause
"""Requests of the page's buttons to the process of tracking."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

#: Has something done in the other process: its name and arguments; returns what came of it.
Ask = Callable[..., Any]


class RequestsToSystem:
    """Asks a system in another process; see `orbslam2py.viewer.controls.SystemActions`.

    Parameters
    ----------
    ask : callable
        Leads to it.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask

    def set_localization(self, wanted: bool) -> str | None:
        """Switch localization mode."""
        return _words(self._ask("set_localization", wanted))

    def reset(self) -> str | None:
        """Begin a new map with the next image."""
        return _words(self._ask("reset"))

    def optimize(self) -> str | None:
        """Run full bundle adjustment of the whole map now."""
        return _words(self._ask("optimize"))

    def save(self) -> str | None:
        """Write the map to a file."""
        return _words(self._ask("save"))


class RequestsToRun:
    """Asks a run in another process; see `orbslam2py.viewer.controls.RunActions`.

    Parameters
    ----------
    ask : callable
        Leads to it.
    """

    def __init__(self, ask: Ask) -> None:
        self._ask = ask
        self._paused = False

    @property
    def paused(self) -> bool:
        """Whether it is paused by this page."""
        return self._paused

    def pause(self) -> None:
        """Let it stand still."""
        self._ask("pause")
        self._paused = True

    def resume(self) -> None:
        """Let it go on."""
        self._ask("resume")
        self._paused = False

    def step(self) -> None:
        """Take one frame."""
        self._ask("step")
        self._paused = True

    def stop(self) -> None:
        """End it."""
        self._ask("stop")


def _words(answer: Any) -> str | None:
    return answer if isinstance(answer, str) else None
