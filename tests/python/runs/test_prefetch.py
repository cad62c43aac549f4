# SPDX-License-Identifier: BSD-3-Clause
"""Reading ahead."""

from __future__ import annotations

import threading
import time

import pytest

from orbslam2py.runs.prefetch import Prefetcher
from support.watchdog import worker_threads

pytestmark = pytest.mark.watchdog(20)


class Loader:
    """Squares; some raise."""

    def __init__(self, bad: tuple[int, ...] = ()) -> None:
        self.loaded: list[int] = []
        self._bad = bad

    def load(self, index: int, /) -> int:
        self.loaded.append(index)
        if index in self._bad:
            raise OSError(f"no {index}")
        return index**2


def test_items_come_in_order() -> None:
    with Prefetcher[int](Loader(), range(3, 300, 3)) as items:
        assert list(items) == [(i, i**2) for i in range(3, 300, 3)]


def test_an_exception_takes_the_place_of_its_item() -> None:
    with Prefetcher[int](Loader(bad=(0, 2, 4)), range(5)) as items:
        got = list(items)
    assert [index for index, _ in got] == [0, 1, 2, 3, 4]
    assert [isinstance(item, OSError) for _, item in got] == [True, False, True, False, True]


def test_reads_only_a_few_ahead() -> None:
    loader = Loader()
    with Prefetcher[int](loader, range(1000), ahead=3) as items:
        iterator = iter(items)
        next(iterator)
        time.sleep(0.05)
        assert 1 <= len(loader.loaded) <= 5
    assert len(loader.loaded) <= 6


def test_leaving_early_ends_the_thread() -> None:
    with pytest.raises(ZeroDivisionError), Prefetcher[int](Loader(), range(1000)) as items:
        for index, _ in items:
            _ = 1 / (index - 3)
    assert worker_threads() == []


def test_stop_ends_a_wait_for_an_item() -> None:
    release, stop = threading.Event(), threading.Event()

    class Stuck:
        def load(self, index: int, /) -> int:
            if index == 2:
                release.wait(15)
            return index

    got = []
    with Prefetcher[int](Stuck(), range(5), stop=stop) as items:
        threading.Timer(0.1, stop.set).start()
        got = [index for index, _ in items]
        release.set()
    assert got == [0, 1]
