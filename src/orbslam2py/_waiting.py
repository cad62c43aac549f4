# SPDX-License-Identifier: BSD-3-Clause
"""Waiting without a limit that Ctrl-C can interrupt.

Python handles a signal in its main thread, between two steps of the program. A signal just before
an unlimited wait, or in another thread, does not end the wait: the program would stay blocked until
a second signal.
"""

from __future__ import annotations

import threading

#: Longest uninterrupted wait in seconds; between two of these, signals such as Ctrl-C are handled.
WAIT_SLICE = 0.2


def wait_for_event(event: threading.Event) -> None:
    """Wait until it is set, or until the handler of a signal raises."""
    while not event.wait(WAIT_SLICE):
        pass
