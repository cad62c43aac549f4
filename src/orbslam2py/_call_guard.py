# SPDX-License-Identifier: BSD-3-Clause
"""One call at a time: for objects that are used from several threads, but not at once."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

from orbslam2py.errors import StateError


class CallGuard:
    """Allows one call at a time; a second one raises instead of waiting."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def __call__(self) -> Iterator[None]:
        """Enter the guarded call."""
        if not self._lock.acquire(blocking=False):
            raise StateError(f"{self._what} is already running in another thread")
        try:
            yield
        finally:
            self._lock.release()
