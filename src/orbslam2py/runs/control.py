# SPDX-License-Identifier: BSD-3-Clause
"""Control of a run from another thread: pause, step, stop."""

from __future__ import annotations

import threading
import time

#: Seconds between two looks at whether the run was stopped.
_WAIT_SLICE = 0.1


class RunControl:
    """Requests of another thread to a run: stop, pause, process one frame.

    Parameters
    ----------
    stop : threading.Event, optional
        Ends the run after the present frame when it is set.

    Attributes
    ----------
    stop : threading.Event
        The event, or a new one.
    """

    def __init__(self, stop: threading.Event | None = None) -> None:
        self.stop = stop or threading.Event()
        self._condition = threading.Condition()
        self._paused = False
        self._steps = 0

    @property
    def paused(self) -> bool:
        """Whether the run is paused, or will be after the present frame."""
        return self._paused

    def pause(self) -> None:
        """Pause the run after the present frame."""
        with self._condition:
            self._paused, self._steps = True, 0

    def resume(self) -> None:
        """Let it continue."""
        with self._condition:
            self._paused = False
            self._condition.notify_all()

    def step(self) -> None:
        """Process one frame and pause again."""
        with self._condition:
            self._paused = True
            self._steps += 1
            self._condition.notify_all()

    def wait(self) -> float:
        """Wait while the run is paused; returns for how long [s]."""
        if not self._paused:
            return 0.0
        begin = time.perf_counter()
        with self._condition:
            while self._paused and not self._steps and not self.stop.is_set():
                self._condition.wait(_WAIT_SLICE)
            self._steps = max(0, self._steps - 1)
        return time.perf_counter() - begin
