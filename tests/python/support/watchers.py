# SPDX-License-Identifier: BSD-3-Clause
"""Watchers that remember what they were told."""

from __future__ import annotations

import threading
from collections.abc import Callable

from orbslam2py.maps.changes import MapChanges
from orbslam2py.slam.events import Event
from orbslam2py.viewer import FrameView

#: Seconds that a condition may take on a busy computer.
PATIENCE = 30.0


class Notebook:
    """Writes down everything; optionally fails, or waits, at frames."""

    name = "the notebook"

    def __init__(self, at_frame: Callable[[FrameView], None] | None = None) -> None:
        self._at_frame = at_frame
        self._condition = threading.Condition()
        self.views: list[FrameView] = []
        self.changes: list[MapChanges] = []
        self.events: list[Event] = []
        self.n_closed = 0

    def on_frame(self, view: FrameView) -> None:
        self._note(lambda: self.views.append(view))
        if self._at_frame is not None:
            self._at_frame(view)

    def on_map(self, changes: MapChanges) -> None:
        self._note(lambda: self.changes.append(changes))

    def on_event(self, event: Event) -> None:
        self._note(lambda: self.events.append(event))

    def close(self) -> None:
        def count() -> None:
            self.n_closed += 1

        self._note(count)

    def wait_for(self, condition: Callable[[Notebook], bool]) -> None:
        with self._condition:
            assert self._condition.wait_for(lambda: condition(self), PATIENCE)

    def _note(self, write: Callable[[], None]) -> None:
        with self._condition:
            write()
            self._condition.notify_all()
