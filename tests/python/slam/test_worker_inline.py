# SPDX-License-Identifier: BSD-3-Clause
"""Workers without a thread of their own."""

from __future__ import annotations

import threading

import pytest

from orbslam2py import StateError, WorkerError
from orbslam2py._worker import Worker, WorkerState
from support.worker_steps import NAME, failing

pytestmark = pytest.mark.watchdog(10)


def test_inline_runs_at_once_in_the_callers_thread() -> None:
    threads: list[threading.Thread] = []
    states: list[WorkerState] = []

    def step(_: int) -> None:
        threads.append(threading.current_thread())
        states.append(worker.state)
        assert not worker.interrupt_flag.is_set()
        assert worker.lower_interrupt()

    worker: Worker[int] = Worker(NAME, step, threaded=False)
    worker.start()
    worker.interrupt()
    worker.submit(0)
    assert threads == [threading.current_thread()]
    assert states == [WorkerState.BUSY]
    assert worker.idle
    assert worker.n_waiting == 0
    worker.reset(10)
    worker.finish(drain=True)
    with pytest.raises(StateError):
        worker.submit(1)


@pytest.mark.parametrize("threaded", [True, False])
def test_jobs_submitted_together_are_all_queued_before_the_first_begins(threaded: bool) -> None:
    seen: list[tuple[int, int, bool, bool]] = []

    def step(job: int) -> None:
        waiting = worker.waiting_flag.is_set()
        seen.append((job, worker.n_waiting, waiting, worker.lower_interrupt()))

    worker: Worker[int] = Worker(NAME, step, threaded=threaded)
    worker.start()
    worker.submit(*range(3))
    worker.submit()
    assert worker.wait_until_idle(10)
    worker.finish()
    assert seen == [(0, 2, True, False), (1, 1, True, False), (2, 0, False, True)]


def test_inline_failure_drops_the_jobs_behind() -> None:
    begun: list[int] = []

    def step(job: int) -> None:
        begun.append(job)
        raise KeyboardInterrupt

    worker = Worker(NAME, step, threaded=False)
    with pytest.raises(KeyboardInterrupt):
        worker.submit(0, 1)
    assert begun == [0]
    assert worker.idle
    assert worker.n_waiting == 0
    assert not worker.waiting_flag.is_set()


def test_inline_failure() -> None:
    worker = Worker(NAME, failing, threaded=False)
    worker.submit(0)
    with pytest.raises(WorkerError, match="bad job") as caught:
        worker.submit(1)
    assert isinstance(caught.value.__cause__, ValueError)
    assert worker.state is WorkerState.FAILED
    with pytest.raises(WorkerError):
        worker.submit(2)
    with pytest.raises(WorkerError):
        worker.finish()


def test_a_step_cannot_wait_for_its_own_end() -> None:
    """It would wait for ever: no other thread is at work."""
    heard: list[str] = []

    def step(_: int) -> None:
        with pytest.raises(StateError, match="cannot be waited for within a callback") as raised:
            worker.wait_until_idle()
        assert not worker.wait_until_idle(5.0)
        heard.append(str(raised.value))

    worker: Worker[int] = Worker(NAME, step, threaded=False)
    worker.submit(0)
    assert len(heard) == 1
    assert NAME in heard[0]
    assert worker.wait_until_idle()


def test_another_thread_may_wait_for_the_end_of_an_inline_step() -> None:
    results: list[bool] = []
    entered, leave = threading.Event(), threading.Event()

    def step(_: int) -> None:
        entered.set()
        leave.wait(5)

    worker: Worker[int] = Worker(NAME, step, threaded=False)
    caller = threading.Thread(target=worker.submit, args=(0,))
    caller.start()
    assert entered.wait(5)
    waiter = threading.Thread(target=lambda: results.append(worker.wait_until_idle(5)))
    waiter.start()
    leave.set()
    caller.join(5)
    waiter.join(5)
    assert results == [True]
