# SPDX-License-Identifier: BSD-3-Clause
"""Images decoded ahead in a thread of their own."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Iterator, Sequence
from typing import Generic, Protocol, TypeVar

_log = logging.getLogger(__name__)

Item = TypeVar("Item")
Loaded_co = TypeVar("Loaded_co", covariant=True)

#: Seconds between two looks at whether the other side is still there.
_WAIT_SLICE = 0.2

#: Seconds that the end waits for an item that is being loaded, say from a network that is gone.
_PATIENCE = 1.0


class Loader(Protocol[Loaded_co]):
    """What a `Prefetcher` reads from."""

    def load(self, index: int, /) -> Loaded_co:
        """Load one item."""
        ...


class Prefetcher(Generic[Item]):
    """Iterates over ``load(i)`` for the given indices, a few steps ahead.

    An `Exception` in ``load`` does not end the iteration: it is delivered in the place of its item,
    so that a bad image can be skipped. Use as a context manager; leaving it ends the thread.

    Parameters
    ----------
    loader : Loader
        Where the items come from; called in the other thread only.
    indices : sequence of int
        What to load, in order.
    ahead : int
        Items held at most.
    stop : threading.Event, optional
        Ends the iteration when it is set, also while an item is being waited for.
    """

    def __init__(
        self,
        loader: Loader[Item],
        indices: Sequence[int],
        ahead: int = 4,
        stop: threading.Event | None = None,
    ) -> None:
        self._loader = loader
        self._indices = indices
        self._stop = stop or threading.Event()
        self._queue: queue.Queue[tuple[int, Item | Exception]] = queue.Queue(ahead)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="image loader", daemon=True)

    def __enter__(self) -> Prefetcher[Item]:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        self._thread.join(_PATIENCE)
        if self._thread.is_alive():
            _log.warning("an image is still being read; it is not waited for")

    def __iter__(self) -> Iterator[tuple[int, Item | Exception]]:
        for _ in self._indices:
            while not self._stop.is_set():
                try:
                    yield self._queue.get(timeout=_WAIT_SLICE)
                    break
                except queue.Empty:
                    if not self._thread.is_alive() and self._queue.empty():
                        return
            if self._stop.is_set():
                return

    def _run(self) -> None:
        for index in self._indices:
            item: Item | Exception
            try:
                item = self._loader.load(index)
            except Exception as error:
                item = error
            while not self._stopped.is_set():
                try:
                    self._queue.put((index, item), timeout=_WAIT_SLICE)
                    break
                except queue.Full:
                    continue
            if self._stopped.is_set():
                return
