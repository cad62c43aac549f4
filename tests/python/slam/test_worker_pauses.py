# SPDX-License-Identifier: BSD-3-Clause
"""Workers: pauses, and steps with a part that leaves the map alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest

from orbslam2py._worker import Worker, WorkerState
from support.worker_steps import NAME, Gate, eventually

pytestmark = pytest.mark.watchdog(10)


# ---- pauses --------------------------------------------------------------------------------------
def test_pauses_are_counted(worker: Worker[int], gate: Gate) -> None:
    """In the original one release cancels the stops that others asked for (OD-122, OD-137)."""
    gate.open()
    first, second = worker.pause(), worker.pause()
    assert first.wait(10)
    assert worker.pausing
    assert worker.state is WorkerState.PAUSED
    worker.submit(0)
    first.release()
    first.release()  # a ticket counts once
    assert worker.pausing
    assert not worker.wait_until_idle(0.05)
    assert gate.begun == []
    second.release()
    assert worker.wait_until_idle(10)
    assert gate.done == [0]
    assert not worker.pausing


def test_pause_takes_hold_after_the_running_job(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    worker.submit(1)
    with worker.pause() as ticket:
        assert worker.interrupt_flag.is_set()
        assert not ticket.wait(0.02), "the job still runs"
        gate.open()
        assert ticket.wait(10)
        assert gate.done == [0]
    assert worker.wait_until_idle(10)
    assert gate.done == [0, 1]


def test_ticket_is_released_when_its_block_raises(worker: Worker[int]) -> None:
    with pytest.raises(ZeroDivisionError), worker.pause():
        _ = 1 / 0
    assert not worker.pausing


def test_a_brief_pause_is_waited_for(worker: Worker[int], gate: Gate) -> None:
    gate.open()
    ticket = worker.pause(brief=True)
    assert worker.pausing
    assert not worker.held
    worker.submit(0)
    threading.Timer(0.05, ticket.release).start()
    worker.wait_until_waiting(at_most=1)
    assert not worker.pausing
    assert worker.wait_until_idle(10)


def test_draining_goes_on_through_a_brief_pause(gate: Gate) -> None:
    gate.open()
    worker = Worker(NAME, gate, threaded=True)
    worker.start()
    ticket = worker.pause(brief=True)
    worker.submit(0)
    threading.Timer(0.05, ticket.release).start()
    worker.finish(drain=True, timeout=10)
    assert gate.done == [0]


# ---- steps with a part that leaves the map alone -------------------------------------------------
class Solver:
    """A step with a long part off duty; it commits unless it is cancelled."""

    def __init__(self) -> None:
        self.entered = threading.Event()
        self.solved = threading.Event()
        self.commits: list[int] = []
        self.worker: Worker[int] = Worker(NAME, self, threaded=True)
        self.worker.start()

    def __call__(self, job: int) -> None:
        with self.worker.off_duty():
            self.entered.set()
            while not (self.solved.wait(0.001) or self.worker.cancel_flag.is_set()):
                pass
        if not self.worker.cancel_flag.is_set():
            self.commits.append(job)


@pytest.fixture
def solver() -> Iterator[Solver]:
    solver = Solver()
    solver.worker.submit(1)
    assert solver.entered.wait(10)
    yield solver
    solver.worker.finish(timeout=10)


def test_a_pause_does_not_wait_for_what_leaves_the_map_alone(solver: Solver) -> None:
    with solver.worker.pause() as ticket:
        assert ticket.wait(1)
        assert solver.worker.state is WorkerState.BUSY
        solver.solved.set()
        time.sleep(0.05)
        assert solver.commits == [], "the end of the solve waits for the end of the pause"
    assert solver.worker.wait_until_idle(10)
    assert solver.commits == [1]


def test_reset_gives_up_what_is_being_solved(solver: Solver) -> None:
    solver.worker.reset(1)
    assert solver.worker.wait_until_idle(10)
    assert solver.commits == []
    solver.solved.set()
    solver.worker.submit(2)
    assert solver.worker.wait_until_idle(10)
    assert solver.commits == [2], "only the step that was running is given up"


def test_reset_while_paused_gives_up_what_is_being_solved(solver: Solver) -> None:
    with solver.worker.pause():
        solver.worker.reset(1)
        assert solver.worker.wait_until_idle(10)
    assert solver.commits == []


def test_finish_gives_up_what_is_being_solved(solver: Solver) -> None:
    solver.worker.finish(timeout=10)
    assert solver.commits == []


def test_finish_while_the_end_of_a_solve_waits_for_a_pause(solver: Solver) -> None:
    ticket = solver.worker.pause()
    solver.solved.set()
    solver.worker.finish(timeout=10)
    assert solver.commits == []
    ticket.release()


def test_draining_waits_for_what_is_being_solved(solver: Solver) -> None:
    threading.Timer(0.05, solver.solved.set).start()
    solver.worker.finish(drain=True, timeout=10)
    assert solver.commits == [1]


def test_lower_interrupt_refuses_during_a_reset(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    thread = threading.Thread(target=worker.reset)
    thread.start()
    eventually(worker.cancel_flag.is_set)
    assert not worker.lower_interrupt(), "the interruptible part would be waited for"
    gate.open()
    thread.join(10)
    worker.submit(1)
    assert worker.wait_until_idle(10)
    assert not worker.cancel_flag.is_set()


def test_an_inline_worker_stands_still_for_whom_its_step_calls() -> None:
    waited: list[bool] = []

    def step(_: int) -> None:
        with worker.pause(brief=True) as ticket, worker.off_duty():
            waited.append(ticket.wait())

    worker: Worker[int] = Worker(NAME, step, threaded=False)
    worker.submit(0)
    assert waited == [True]
