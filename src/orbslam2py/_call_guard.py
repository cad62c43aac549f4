# SPDX-License-Identifier: BSD-3-Clause
"""One call at a time: for objects used from several threads, but not concurrently."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

from orbslam2py.errors import StateError


class CallGuard:
    """Allows one call at a time; a second one raises instead of waiting."""

    def __init__(self, what: str) -> None:
        self._what = what
        # One that knows its owner: should a Ctrl-C come right after it was taken, its thread can
        # take it again, and need not wait for itself.
        self._lock = threading.RLock()
        self._owner: int | None = None  # the thread that is in the call

    @contextlib.contextmanager
    def __call__(self) -> Iterator[None]:
        """Enter the guarded call."""
        inside = self._owner == threading.get_ident()
        if inside or not self._lock.acquire(blocking=False):
            raise StateError(f"{self._what} is already running in another thread")
        self._owner = threading.get_ident()
        try:
            yield
        finally:
            self._owner = None
            self._lock.release()

    def wait_until_left(self, timeout: float | None = None) -> bool:
        """Wait until no other thread is in the call; False if `timeout` seconds are over first."""
        if self._owner == threading.get_ident():
            return True
        if not self._lock.acquire(timeout=-1 if timeout is None else timeout):
            return False
        self._lock.release()
        return True
