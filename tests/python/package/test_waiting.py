# SPDX-License-Identifier: BSD-3-Clause
"""An endless wait hears a Ctrl-C that did not wake it."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading

import pytest

from orbslam2py._waiting import wait_for_event

pytestmark = pytest.mark.skipif(
    not hasattr(signal, "pthread_kill"), reason="signals are sent to processes only here"
)

#: The signal reaches another thread, as it may by the rules of POSIX.
PROGRAM = """
import contextlib, signal, threading, time
from orbslam2py._waiting import wait_for_event

def press():
    time.sleep(0.5)
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)
    time.sleep(60)

threading.Thread(target=press, daemon=True).start()
with contextlib.suppress(KeyboardInterrupt):
    wait_for_event(threading.Event())
print("heard")
"""


def test_a_signal_that_another_thread_receives_ends_the_wait() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "heard\n", done.stderr


def test_it_returns_when_the_event_is_set() -> None:
    event = threading.Event()
    timer = threading.Timer(0.05, event.set)
    timer.start()
    wait_for_event(event)
    assert event.is_set()
