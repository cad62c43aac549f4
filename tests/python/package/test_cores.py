# SPDX-License-Identifier: BSD-3-Clause
"""How many threads there are for work that can be divided."""

from __future__ import annotations

import os

import pytest

from orbslam2py._cores import n_cores, n_threads


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
