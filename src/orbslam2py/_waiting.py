# SPDX-License-Identifier: BSD-3-Clause
"""Waiting without end, in which a Ctrl-C is heard.

The interpreter notes a signal and handles it in its main thread, between two steps of the program.
A signal that comes just before an endless wait begins, or that another thread received, does not
wake it: the program would stand still until a second one.
"""

from __future__ import annotations

import threading

#: Longest uninterrupted wait in seconds; between two of these, signals such as Ctrl-C are handled.
WAIT_SLICE = 0.2


def wait_for_event(event: threading.Event) -> None:
    """Wait until it is set, or until a signal's handler raises."""
    while not event.wait(WAIT_SLICE):
        pass
