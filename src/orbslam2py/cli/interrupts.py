# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C as a request, so that nothing is broken off half-way."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


class StopOnInterrupt:
    """In its ``with`` block the first Ctrl-C sets `event`; the next ones interrupt as usual.

    Where Ctrl-C is ignored (a job in the background) it stays ignored.

    Attributes
    ----------
    event : threading.Event
        Set once Ctrl-C was pressed.
    """

    def __init__(self) -> None:
        self.event = threading.Event()

    def __enter__(self) -> StopOnInterrupt:
        self._before = signal.getsignal(signal.SIGINT)
        self._installed = (
            callable(self._before) and threading.current_thread() is threading.main_thread()
        )
        if self._installed:
            signal.signal(signal.SIGINT, self._on_interrupt)
        return self

    def __exit__(self, *_: object) -> None:
        if self._installed:
            signal.signal(signal.SIGINT, self._before)

    def _on_interrupt(self, _number: int, _frame: FrameType | None) -> None:
        if self.event.is_set():
            raise KeyboardInterrupt
        self.event.set()


@contextlib.contextmanager
def hold_while_loading() -> Iterator[None]:
    """Let the first Ctrl-C wait until the libraries of the block are loaded.

    Loading takes a second at most, and some libraries drop whatever exception comes up meanwhile or
    make another one of it: the program would go on, or end with a traceback.

    Raises
    ------
    KeyboardInterrupt
        At the end of the block, or at the second Ctrl-C.
    """
    with StopOnInterrupt() as interrupt:
        yield
    if interrupt.event.is_set():
        raise KeyboardInterrupt
