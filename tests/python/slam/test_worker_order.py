# SPDX-License-Identifier: BSD-3-Clause
"""Workers: the order of jobs, flags, several threads at the controls."""

from __future__ import annotations

import threading

import pytest

from orbslam2py import OrbSlamError, StateError, WorkerError
from orbslam2py._call_guard import CallGuard
from orbslam2py._worker import Worker, WorkerState
from support.worker_steps import NAME, Gate, eventually, once

pytestmark = pytest.mark.watchdog(10)


# ---- order and flags -----------------------------------------------------------------------------
def test_jobs_run_in_order_of_submission() -> None:
    done: list[int] = []
    worker = Worker(NAME, done.append, threaded=True)
    worker.start()
    for job in range(200):
        worker.submit(job)
    assert worker.wait_until_idle(10)
    assert done == list(range(200))
    worker.finish(timeout=10)


def test_drained_finish_runs_every_waiting_job(worker: Worker[int], gate: Gate) -> None:
    for job in range(5):
        worker.submit(job)
    gate.open()
    worker.finish(drain=True, timeout=10)
    assert gate.done == [0, 1, 2, 3, 4]


def test_finish_drops_waiting_jobs_and_interrupts(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    worker.submit(1)
    once(worker.cancel_flag.is_set, gate.open)
    worker.finish(timeout=10)
    assert gate.done == [0]
    assert worker.interrupt_flag.is_set()
    assert worker.n_waiting == 0
    assert worker.state is WorkerState.FINISHED


def test_states(worker: Worker[int], gate: Gate) -> None:
    assert worker.state is WorkerState.IDLE
    assert worker.idle
    worker.submit(0)
    gate.wait_begun()
    assert worker.state is WorkerState.BUSY
    assert not worker.idle
    worker.submit(1)
    assert worker.n_waiting == 1
    assert worker.waiting_flag.is_set()
    assert worker.interrupt_flag.is_set(), "a waiting job asks the running one to hurry"
    gate.open(1)
    gate.wait_begun()
    assert not worker.waiting_flag.is_set(), "nothing waits behind the second job"
    assert not worker.interrupt_flag.is_set(), "the request was meant for the first job"
    gate.open()
    assert worker.wait_until_idle(10)


def test_flags_stay_raised_while_a_third_job_waits(worker: Worker[int], gate: Gate) -> None:
    for job in range(3):
        worker.submit(job)
    gate.wait_begun()
    gate.open(1)
    gate.wait_begun()
    assert gate.begun == [0, 1]
    assert worker.waiting_flag.is_set()
    assert worker.interrupt_flag.is_set()


def test_interrupt_reaches_the_running_job_only(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    worker.interrupt()
    assert worker.interrupt_flag.is_set()
    gate.open(1)
    assert worker.wait_until_idle(10)
    worker.submit(1)
    gate.wait_begun()
    eventually(lambda: not worker.interrupt_flag.is_set())


# ---- lowering the interrupt ----------------------------------------------------------------------
def test_lower_interrupt_lowers_a_stale_request(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    worker.interrupt()
    assert worker.lower_interrupt()
    assert not worker.interrupt_flag.is_set()


def test_lower_interrupt_refuses_while_a_job_waits(worker: Worker[int], gate: Gate) -> None:
    """The original's mapper may erase an interrupt just before it would be read (OD-127)."""
    worker.submit(0)
    gate.wait_begun()
    worker.submit(1)
    assert not worker.lower_interrupt()
    assert worker.interrupt_flag.is_set()


def test_lower_interrupt_refuses_while_a_pause_is_asked_for(
    worker: Worker[int], gate: Gate
) -> None:
    worker.submit(0)
    gate.wait_begun()
    with worker.pause():
        assert not worker.lower_interrupt()
        assert worker.interrupt_flag.is_set()
    assert worker.lower_interrupt()


def test_lower_interrupt_refuses_while_finishing(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    with pytest.raises(WorkerError, match=r"did not end within 0\.05 s"):
        worker.finish(timeout=0.05)
    assert not worker.lower_interrupt()


# ---- waiting -------------------------------------------------------------------------------------
def test_wait_until_waiting(worker: Worker[int], gate: Gate) -> None:
    for job in range(4):
        worker.submit(job)
    gate.wait_begun()
    threading.Timer(0.02, gate.open, (2,)).start()
    worker.wait_until_waiting(at_most=1)
    assert worker.n_waiting <= 1
    assert gate.done[:2] == [0, 1]


def test_wait_until_waiting_returns_when_paused(worker: Worker[int]) -> None:
    with worker.pause():
        for job in range(4):
            worker.submit(job)
        worker.wait_until_waiting(at_most=1)
        worker.reset(10)


def test_wait_until_idle_times_out(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    assert not worker.wait_until_idle(0.02)


# ---- guard and stress ----------------------------------------------------------------------------
def test_guard_allows_one_call_at_a_time() -> None:
    guard = CallGuard("tracking")
    with guard(), pytest.raises(StateError, match="tracking is already running"), guard():
        pass
    with pytest.raises(KeyError), guard():
        raise KeyError
    with guard():
        pass


def test_guard_waits_for_a_call_in_another_thread() -> None:
    guard = CallGuard("tracking")
    assert guard.wait_until_left()
    with guard():
        assert guard.wait_until_left(), "a call cannot wait for its own end"
        left: list[bool] = []
        waiting = threading.Thread(target=lambda: left.append(guard.wait_until_left(0.02)))
        waiting.start()
        waiting.join()
        assert left == [False]
    with guard():
        pass


def test_many_controls_from_several_threads() -> None:
    done: list[int] = []

    def step(job: int) -> None:
        worker.lower_interrupt()
        done.append(job)

    worker = Worker(NAME, step, threaded=True)
    worker.start()
    errors: list[BaseException] = []

    def control(seed: int) -> None:
        try:
            for i in range(60):
                kind = (i * 7 + seed) % 5
                if kind == 0:
                    worker.submit(i)
                elif kind == 1:
                    with worker.pause() as ticket:
                        assert ticket.wait(10)
                elif kind == 2:
                    worker.reset(10)
                elif kind == 3:
                    worker.interrupt()
                else:
                    worker.wait_until_waiting(at_most=0)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=control, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(15)
        assert not thread.is_alive()
    assert errors == []
    assert worker.wait_until_idle(10)
    worker.submit(-1)
    worker.finish(drain=True, timeout=10)
    assert done[-1] == -1


def test_worker_errors_are_errors_of_the_package() -> None:
    assert issubclass(WorkerError, OrbSlamError)
