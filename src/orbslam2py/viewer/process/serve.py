# SPDX-License-Identifier: BSD-3-Clause
"""The process of the page: draws the data of the run, and requests more for its users."""

from __future__ import annotations

import contextlib
import logging
import os
import queue
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from socket import socket
from typing import TYPE_CHECKING, Any

from orbslam2py.viewer.process.channel import Channel

if TYPE_CHECKING:
    from orbslam2py.viewer.process.live_page import LivePage

#: How much less urgent than tracking, of 19.
_NICE = 10
#: Seconds between two looks whether the other process is still there.
_LOOK = 1.0
#: What must be drawn before more of it is sent.
_PACED = frozenset({"on_frame", "on_map", "on_resting_maps", "on_event"})


class Parent:
    """The process of tracking, from the side of the page.

    Parameters
    ----------
    channel : Channel
        Leads to it.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self.messages: queue.SimpleQueue[tuple[Any, ...]] = queue.SimpleQueue()
        self._condition = threading.Condition()
        self._answers: dict[int, Any] = {}
        self._n_asked = 0

    def tell(self, *message: Any) -> None:
        """Send a message; without a receiver this process ends."""
        try:
            self._channel.send(*message)
        except OSError:
            os._exit(0)

    def ask(self, name: str, *arguments: Any) -> Any:
        """Call a function there, and wait for the result; None if it failed."""
        with self._condition:
            self._n_asked += 1
            number = self._n_asked
        self.tell("ask", number, name, arguments)
        with self._condition:
            self._condition.wait_for(lambda: number in self._answers)
            return self._answers.pop(number)

    def read(self) -> None:
        """Process messages until the other process ends; then this one ends, too."""
        while (message := self._channel.receive()) is not None:
            if message[0] == "answer":
                with self._condition:
                    self._answers[message[1]] = message[2]
                    self._condition.notify_all()
            else:
                self.messages.put(message)
        os._exit(0)


class _LogToParent(logging.Handler):
    """Forwards log messages of the package to the other process, which handles them."""

    def __init__(self, parent: Parent) -> None:
        super().__init__(logging.WARNING)
        self._parent = parent

    def emit(self, record: logging.LogRecord) -> None:
        self._parent.tell("log", record.name, record.levelno, record.getMessage())


def main(number: int) -> None:
    """Serve until the other process sends stop, or ends.

    Parameters
    ----------
    number : int
        File descriptor of the socket to it.
    """
    _end_with(os.getppid())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run
    os.nice(_NICE)
    parent = Parent(Channel(socket(fileno=number)))
    threading.Thread(target=parent.read, name="parent", daemon=True).start()
    logging.getLogger("orbslam2py").addHandler(_LogToParent(parent))
    _, host, port, title, stand_back = parent.messages.get()
    page = _open(parent, host, port, title)
    if page is None:
        return
    if stand_back:
        _stand_back()
    parent.tell("opened", page.address)
    _serve(parent, page)


def _end_with(process: int) -> None:
    """End with the other process; a copy of its socket may remain in one of its children."""

    def watch() -> None:
        while os.getppid() == process:
            time.sleep(_LOOK)
        os._exit(0)

    threading.Thread(target=watch, name="watch", daemon=True).start()


def _open(parent: Parent, host: str, port: int | None, title: str) -> LivePage | None:
    import cv2  # noqa: PLC0415  # when Ctrl-C is out of reach: it is large
    import numpy.ma  # noqa: F401, PLC0415  # which numpy.unique loads, beside the first images

    from orbslam2py.errors import StateError  # noqa: PLC0415
    from orbslam2py.viewer.process.live_page import LivePage  # noqa: PLC0415

    cv2.setNumThreads(1)  # all cores are tracking's
    try:
        page = LivePage(parent.ask, host=host, port=port, title=title)
    except StateError as error:
        parent.tell("refused", str(error))
        return None
    return page


def _stand_back() -> None:
    """Use only idle time of the processor, if the system supports this (Linux).

    A thread of lower priority keeps its core for some milliseconds when tracking wakes up.
    """
    if not hasattr(os, "SCHED_IDLE"):
        return
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # it has ended
            os.sched_setscheduler(int(thread.name), os.SCHED_IDLE, os.sched_param(0))


def _serve(parent: Parent, page: LivePage) -> None:
    calls: dict[str, Callable[..., None]] = {
        "attach": page.attach,
        "on_frame": page.on_frame,
        "on_map": page.on_map,
        "on_resting_maps": page.on_resting_maps,
        "on_event": page.on_event,
        "close": page.close,
        "tell_end": page.tell_end,
        "look_from": page.look_from,
    }
    while True:
        name, *arguments = parent.messages.get()
        if name == "stop":
            page.stop()
            # Threads that serve browsers may wait for them, and there is nothing left to be saved.
            os._exit(0)
        try:
            calls[name](*arguments)
        except Exception as error:
            parent.tell("failed", f"{type(error).__name__}: {error}")
            raise
        if name in _PACED:
            parent.tell("done")
