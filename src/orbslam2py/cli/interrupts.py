# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C and other signals as requests: no step is aborted."""

from __future__ import annotations

import _thread
import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

from orbslam2py.cli.exit_codes import ExitCode

_Handler = Callable[[int, "FrameType | None"], object]

#: What asks for an end besides Ctrl-C, and what the program ends with then: ``kill``, ``timeout``
#: and managers of jobs; a terminal that is closed, or a connection to it that breaks.
_ENDINGS = {signal.SIGTERM: ExitCode.TERMINATED, signal.SIGHUP: ExitCode.HUNG_UP}
#: Signals within this time [s] are one request: ``timeout`` sends its signal to the program and to
#: all of its group, and a shell passes on that its terminal is closed.
_ECHO_SECONDS = 1.0


class EndingSignals:
    """In its ``with`` block SIGTERM and SIGHUP have the effect of Ctrl-C.

    An ignored signal (SIGHUP by ``nohup``) stays ignored. Child processes do not inherit it.

    Attributes
    ----------
    exit_code : ExitCode
        Exit code after an interrupt.
    """

    def __init__(self) -> None:
        self.exit_code = ExitCode.INTERRUPTED
        self._raised_at = -_ECHO_SECONDS
        self._installed: list[signal.Signals] = []
        self._terminals: list[int] = []

    def __enter__(self) -> EndingSignals:
        if threading.current_thread() is threading.main_thread():
            self._terminals = [number for number in range(3) if os.isatty(number)]
            for number in _ENDINGS:
                if signal.getsignal(number) is signal.SIG_DFL:
                    signal.signal(number, self._on_signal)
                    self._installed.append(number)
        return self

    def __exit__(self, *_: object) -> None:
        for number in self._installed:
            signal.signal(number, signal.SIG_DFL)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if self.exit_code is ExitCode.INTERRUPTED:
            self.exit_code = _ENDINGS[signal.Signals(number)]
        self._leave_closed_terminals()
        now = time.monotonic()
        if now - self._raised_at >= _ECHO_SECONDS:
            self._raised_at = now
            raise KeyboardInterrupt

    def _leave_closed_terminals(self) -> None:
        """Drop further output, which would raise errors."""
        for number in self._terminals:
            if not os.isatty(number):
                nowhere = os.open(os.devnull, os.O_RDWR)
                os.dup2(nowhere, number)
                os.close(nowhere)


class _Request(threading.Event):
    """An event that reads as set immediately, even before the setting thread runs."""

    def __init__(self) -> None:
        super().__init__()
        self.asked = False

    def is_set(self) -> bool:
        return self.asked or super().is_set()

    def ask(self) -> None:
        """Set the event; a signal handler may call it."""
        self.asked = True
        # By another thread: this one may be about to wait for the event, and hold its lock. Not
        # through threading.Thread, whose own locks it may hold as well.
        _thread.start_new_thread(self.set, ())


class StopOnInterrupt:
    """In its ``with`` block the first Ctrl-C sets `event`; the next ones interrupt as usual.

    The signals of `EndingSignals` do the same. If Ctrl-C is ignored (a job in the background), it
    stays ignored.

    Attributes
    ----------
    event : threading.Event
        Set after the first request.
    """

    def __init__(self) -> None:
        self._request = _Request()
        self.event: threading.Event = self._request
        self._before: dict[int, _Handler] = {}

    def __enter__(self) -> StopOnInterrupt:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, *_ENDINGS):
                before = signal.getsignal(number)
                if callable(before):
                    self._before[number] = before
                    signal.signal(number, self._on_interrupt)
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        try:
            self._before[number](number, frame)
        except KeyboardInterrupt:
            if self._request.asked:
                raise
            self._request.ask()


@contextlib.contextmanager
def hold_while_loading() -> Iterator[None]:
    """Delay the first Ctrl-C until the libraries of the block are loaded.

    Loading takes at most a second. Some libraries drop or replace exceptions meanwhile: the program
    would continue, or end with a traceback.

    Raises
    ------
    KeyboardInterrupt
        At the end of the block, or at the second Ctrl-C.
    """
    with StopOnInterrupt() as interrupt:
        yield
    if interrupt.event.is_set():
        raise KeyboardInterrupt
