# SPDX-License-Identifier: BSD-3-Clause
"""A test that hangs fails, with the stacks of all threads."""

from __future__ import annotations

import faulthandler
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: A hang takes for ever; a machine that has other things to do takes so many times the usual limit.
_SLOWEST = 4
#: What a test puts in its place may be no file.
_STDERR = sys.__stderr__ or sys.stderr


class HangError(Exception):
    """The time of a test is over."""


@contextmanager
def watchdog(seconds: float) -> Iterator[None]:
    """Raise in the main thread after a multiple of `seconds`; end the process if that is no help.

    `seconds` is far more than is needed where nothing else runs.
    """
    seconds *= _SLOWEST

    def expired(_signal: int, _frame: FrameType | None) -> None:
        faulthandler.dump_traceback(_STDERR)
        raise HangError(f"not done after {seconds} s")

    before = signal.signal(signal.SIGALRM, expired)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    faulthandler.dump_traceback_later(2 * seconds + 10, exit=True, file=_STDERR)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def worker_threads() -> list[str]:
    """Names of the living threads that this package starts."""
    names = {
        "local mapping",
        "loop closing",
        "full bundle adjustment",
        "callbacks",
        "image loader",
        "worker under test",
        "viewer publisher",
        "viewer page",
        "viewer request",
    }
    return [thread.name for thread in threading.enumerate() if thread.name in names]
