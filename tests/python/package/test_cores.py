# SPDX-License-Identifier: BSD-3-Clause
"""How many threads there are for work that can be divided."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time

import pytest

from orbslam2py._cores import n_cores, n_threads, side_by_side


@pytest.fixture(autouse=True)
def many_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbslam2py._cores.n_cores", lambda: 8)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)


def test_there_are_as_many_cores_as_this_process_may_use() -> None:
    assert 1 <= n_cores() <= (os.cpu_count() or 1)


def test_as_many_threads_as_can_share_the_work() -> None:
    assert (n_threads(2), n_threads(6), n_threads(0)) == (2, 6, 1)


def test_at_most_one_thread_a_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbslam2py._cores.n_cores", lambda: 1)
    assert n_threads(6) == 1


@pytest.mark.parametrize(
    ("wanted", "there_are"),
    [("1", 1), ("3", 3), ("16", 6), ("2,1", 2), ("", 6), ("0", 6), ("-1", 6), ("many", 6)],
)
def test_as_many_threads_as_are_wanted(
    monkeypatch: pytest.MonkeyPatch, wanted: str, there_are: int
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", wanted)
    assert n_threads(6) == there_are


def test_work_is_done_once_each_in_the_order_of_the_items() -> None:
    threads: set[int] = set()

    def square(number: int) -> int:
        threads.add(threading.get_ident())
        time.sleep(0.002)
        return number**2

    assert side_by_side(square, range(20)) == [number**2 for number in range(20)]
    assert 1 < len(threads) <= 8
    assert side_by_side(square, []) == []


def test_with_one_thread_the_caller_does_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert set(side_by_side(lambda _: threading.get_ident(), range(5))) == {threading.get_ident()}


def test_an_error_ends_it_and_is_raised() -> None:
    done: list[int] = []

    def work(number: int) -> None:
        if number == 3:
            raise ValueError("three")
        done.append(number)

    with pytest.raises(ValueError, match="three"):
        side_by_side(work, range(1000))
    assert len(done) < 1000


def test_a_thread_that_outlives_the_main_one_may_use_it() -> None:
    code = (
        "import threading, time\n"
        "from orbslam2py._cores import side_by_side\n"
        "def late():\n"
        "    time.sleep(0.5)\n"
        "    print(side_by_side(str, range(3)))\n"
        "threading.Thread(target=late).start()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=50
    )
    assert (done.stdout, done.stderr) == ("['0', '1', '2']\n", "")
