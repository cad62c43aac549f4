# SPDX-License-Identifier: BSD-3-Clause
"""Images decoded ahead in a separate thread."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Generator, Iterable
from typing import TypeVar

_log = logging.getLogger(__name__)

Item = TypeVar("Item")

#: Seconds between two looks at whether the iteration shall stop.
_WAIT_SLICE = 0.2

#: Seconds that the end waits for an item that is being loaded, say from a network that is gone.
_PATIENCE = 1.0


def prefetch(
    load: Callable[[int], Item], indices: Iterable[int], stop: threading.Event, *, ahead: int = 4
) -> Generator[tuple[int, Item | Exception], None, None]:
    """Yield ``load(i)`` for the given indices, loaded a few steps ahead.

    An `Exception` in ``load`` does not end the iteration: it is yielded in place of its item, so
    that a bad image can be skipped. Closing the generator ends the thread. It waits at most a
    second for an item that is being loaded. After that, neither the caller nor the end of the
    process waits for it; with `concurrent.futures.ThreadPoolExecutor` the interpreter would wait.

    Parameters
    ----------
    load
        Loads one item; called only in the other thread.
    indices
        Items to load, in order.
    stop
        Ends the iteration when set, also during a wait for an item.
    ahead
        Largest number of items that are loaded ahead.

    Yields
    ------
    index, item
        In the order of `indices`.
    """
    room = threading.Semaphore(ahead)
    loaded: queue.SimpleQueue[tuple[int, Item | Exception] | None] = queue.SimpleQueue()
    ended = threading.Event()

    def load_all() -> None:
        try:
            for index in indices:
                room.acquire()
                if ended.is_set():
                    break
                loaded.put((index, _item_or_error(load, index)))
        finally:
            loaded.put(None)

    thread = threading.Thread(target=load_all, name="image loader", daemon=True)
    thread.start()
    try:
        while not stop.is_set():
            try:
                found = loaded.get(timeout=_WAIT_SLICE)
            except queue.Empty:
                continue
            if found is None:
                break
            room.release()
            yield found
    finally:
        ended.set()
        room.release()
        thread.join(_PATIENCE)
        if thread.is_alive():
            _log.warning("an image is still being read; it is not waited for")


def _item_or_error(load: Callable[[int], Item], index: int) -> Item | Exception:
    try:
        return load(index)
    except Exception as error:
        return error
