# SPDX-License-Identifier: BSD-3-Clause
"""Reading ahead."""

from __future__ import annotations

import contextlib
import threading
import time

import pytest

from orbslam2py.runs.prefetch import prefetch
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
    items = prefetch(Loader().load, range(3, 300, 3), threading.Event())
    assert list(items) == [(i, i**2) for i in range(3, 300, 3)]


def test_an_exception_takes_the_place_of_its_item() -> None:
    got = list(prefetch(Loader(bad=(0, 2, 4)).load, range(5), threading.Event()))
    assert [index for index, _ in got] == [0, 1, 2, 3, 4]
    assert [isinstance(item, OSError) for _, item in got] == [True, False, True, False, True]


def test_reads_only_a_few_ahead() -> None:
    loader = Loader()
    items = prefetch(loader.load, range(1000), threading.Event(), ahead=3)
    next(items)
    time.sleep(0.05)
    assert 1 <= len(loader.loaded) <= 4
    items.close()
    assert len(loader.loaded) <= 4
    assert worker_threads() == []


def test_leaving_early_ends_the_thread() -> None:
    items = prefetch(Loader().load, range(1000), threading.Event())
    with pytest.raises(ZeroDivisionError), contextlib.closing(items):
        for index, _ in items:
            _ = 1 / (index - 3)
    assert worker_threads() == []


def test_a_loader_that_breaks_off_ends_the_iteration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(threading, "excepthook", lambda _: None)

    def load(index: int) -> int:
        if index == 2:
            raise SystemExit
        return index

    items = prefetch(load, range(5), threading.Event())
    assert list(items) == [(0, 0), (1, 1)]


def test_an_item_that_never_comes_holds_nobody_up(caplog: pytest.LogCaptureFixture) -> None:
    release = threading.Event()
    items = prefetch(lambda _: release.wait(15), range(5), stop := threading.Event())
    threading.Timer(0.1, stop.set).start()
    begin = time.perf_counter()
    assert list(items) == []
    assert time.perf_counter() - begin < 10  # the item takes 15
    assert "an image is still being read" in caplog.text
    release.set()


def test_stop_ends_a_wait_for_an_item() -> None:
    release, stop = threading.Event(), threading.Event()

    def stuck(index: int) -> int:
        if index == 2:
            release.wait(15)
        return index

    threading.Timer(0.1, stop.set).start()
    got = [index for index, _ in prefetch(stuck, range(5), stop)]
    release.set()
    assert got == [0, 1]
