# SPDX-License-Identifier: BSD-3-Clause
"""Order of callers that run the steps of workers in their own threads.

``docs/method/threads.md#deterministic-mode``.
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Iterator

from orbslam2py._waiting import WAIT_SLICE


class Turn:
    """Lets threads with inline steps take turns; a thread may take its turn again inside itself.

    Threads are served in the order of their requests.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._waiting: deque[int] = deque()
        self._depth = 0
        #: The thread whose turn it is; None without one.
        self.owner: int | None = None

    def __enter__(self) -> None:
        self._take(1)

    def __exit__(self, *_: object) -> None:
        with self._condition:
            if self.owner != threading.get_ident():
                return  # lent, and a Ctrl-C came before it was back
            self._depth -= 1
            if self._depth == 0:
                self.owner = None
                self._condition.notify_all()

    @contextlib.contextmanager
    def lent(self) -> Iterator[None]:
        """Leave the turn during a user's callback, which may wait for other callers."""
        me = threading.get_ident()
        with self._condition:
            depth = self._depth if self.owner == me else 0
            if depth:
                self._depth, self.owner = 0, None
                self._condition.notify_all()
        try:
            yield
        finally:
            if depth:
                self._take(depth)

    def _take(self, depth: int) -> None:
        me = threading.get_ident()
        with self._condition:
            if self.owner != me:
                self._waiting.append(me)
                try:
                    while self.owner is not None or self._waiting[0] != me:
                        self._condition.wait(WAIT_SLICE)
                    self.owner = me
                finally:
                    self._waiting.remove(me)
            self._depth += depth
