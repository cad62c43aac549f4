# SPDX-License-Identifier: BSD-3-Clause
"""Steps of a worker that stop, or fail."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

NAME = "worker under test"


class Gate:
    """A step that stops at every job until it is let through."""

    def __init__(self) -> None:
        self.begun: list[int] = []
        self.done: list[int] = []
        self.entered = threading.Semaphore(0)
        self.through = threading.Semaphore(0)

    def __call__(self, job: int) -> None:
        self.begun.append(job)
        self.entered.release()
        assert self.through.acquire(timeout=15)
        self.done.append(job)

    def wait_begun(self) -> None:
        assert self.entered.acquire(timeout=15)

    def open(self, times: int = 1000) -> None:
        for _ in range(times):
            self.through.release()


def eventually(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < end, "did not happen"
        time.sleep(0.001)


def once(condition: Callable[[], bool], act: Callable[[], object]) -> None:
    """Do something in a thread of its own as soon as a condition holds."""

    def wait_and_act() -> None:
        eventually(condition)
        act()

    threading.Thread(target=wait_and_act).start()


def failing(job: int) -> None:
    if job == 1:
        raise ValueError("bad job")
