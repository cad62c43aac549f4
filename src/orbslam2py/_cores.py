# SPDX-License-Identifier: BSD-3-Clause
"""How many processor cores there are for this process."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def n_cores() -> int:
    """Count the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def n_threads(most: int) -> int:
    """Return a number of threads for divisible work: at most one per core, and at most `most`.

    ``OMP_NUM_THREADS`` limits it, as in most libraries; a batch sets it in its workers, which have
    one core each.

    Parameters
    ----------
    most : int
        Largest number of threads that can share the work.
    """
    wanted = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()  # one per nested level
    limit = int(wanted) if wanted.isdecimal() and int(wanted) > 0 else most
    return max(1, min(most, limit, n_cores()))


def side_by_side(work: Callable[[_Item], _Result], items: Iterable[_Item]) -> list[_Result]:
    """Call ``work(item)`` for all items in as many threads as `n_threads` gives.

    It does not use `concurrent.futures.ThreadPoolExecutor`, which takes no work after the end of
    the main thread, although another thread may still deliver images.

    Parameters
    ----------
    work
        The function; called in several threads at a time.
    items
        Arguments, each used once.

    Returns
    -------
    list
        The results, in the order of the items.
    """
    left = list(enumerate(items))[::-1]
    results: dict[int, _Result] = {}
    errors: list[BaseException] = []

    def take() -> None:
        while not errors:
            try:
                number, item = left.pop()  # one at a time, by the interpreter's lock
            except IndexError:
                return
            try:
                results[number] = work(item)
            except BaseException as error:
                errors.append(error)

    helpers = [threading.Thread(target=take) for _ in range(n_threads(len(left)) - 1)]
    for helper in helpers:
        helper.start()
    take()
    for helper in helpers:
        helper.join()
    if errors:
        raise errors[0]
    return [results[number] for number in sorted(results)]
