# SPDX-License-Identifier: BSD-3-Clause
"""Workers without a thread of their own."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator

import pytest

from orbslam2py import StateError, WorkerError
from orbslam2py._turn import Turn
from orbslam2py._worker import Worker, WorkerState, take_turns
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


# ---- callers in several threads ------------------------------------------------------------------
@pytest.fixture
def hasty() -> Iterator[None]:
    """Threads change over as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("hasty")
def test_callers_in_two_threads_take_turns() -> None:
    done: list[int] = []
    at_work: list[int] = []

    def step(job: int) -> None:
        at_work.append(job)
        assert len(at_work) == 1, "two steps at once"
        done.append(job)
        at_work.pop()

    second: Worker[int] = Worker("second", step, threaded=False)
    first = Worker("first", second.submit, threaded=False)
    take_turns((first, second))
    errors: list[Exception] = []

    def call(worker: Worker[int], jobs: range) -> None:
        try:
            for job in jobs:
                worker.submit(job)
                assert job in done, "all is done on return"
        except Exception as error:
            errors.append(error)

    callers = [
        threading.Thread(target=call, args=(worker, range(begin, begin + 300)))
        for worker, begin in ((first, 0), (second, 300), (first, 600))
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert errors == []
    assert sorted(done) == list(range(900))
    assert first.idle
    assert second.idle


def test_a_turn_that_is_interrupted_on_its_way_back_is_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    turn = Turn()

    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), turn, turn, turn.lent():
        monkeypatch.setattr(turn, "_take", interrupted)
    monkeypatch.undo()
    assert turn.owner is None
    owners: list[int | None] = []

    def take() -> None:
        with turn:
            owners.append(turn.owner)

    other = threading.Thread(target=take)
    other.start()
    other.join(5)
    assert owners == [other.ident]
    assert turn.owner is None


class Elsewhere:
    """A worker whose step runs inline in another thread, until it is told to end."""

    def __init__(self) -> None:
        self.entered, self.leave = threading.Event(), threading.Event()
        self.off_duty = False
        self.cancelled: list[bool] = []
        self.worker: Worker[int] = Worker(NAME, self._step, threaded=False)
        self._caller = threading.Thread(target=self.worker.submit, args=(0,))

    def _step(self, _: int) -> None:
        if self.off_duty:
            with self.worker.off_duty():
                self._stay()
        else:
            self._stay()
        self.cancelled.append(self.worker.cancel_flag.is_set())

    def _stay(self) -> None:
        self.entered.set()
        assert self.leave.wait(5)

    def begin(self) -> None:
        self._caller.start()
        assert self.entered.wait(5)

    def end(self) -> None:
        self.leave.set()
        self._caller.join(5)


def test_who_needs_the_map_waits_for_an_inline_step_elsewhere() -> None:
    elsewhere = Elsewhere()
    worker = elsewhere.worker
    elsewhere.begin()
    with worker.pause(brief=True) as ticket:
        assert not ticket.wait(0.02)
    with pytest.raises(WorkerError, match="did not acknowledge the reset"):
        worker.reset(0.02)
    with pytest.raises(WorkerError, match=r"did not end within 0\.02 s"):
        worker.finish(timeout=0.02)
    assert not worker.ended
    elsewhere.end()
    worker.finish(timeout=5)
    assert worker.ended
    assert elsewhere.cancelled == [True]


def test_an_inline_step_off_duty_gives_up_for_a_pause_elsewhere() -> None:
    """The one that holds the pause may wait for its turn: nobody waits for the other."""
    elsewhere = Elsewhere()
    elsewhere.off_duty = True
    elsewhere.begin()
    with elsewhere.worker.pause() as ticket:
        assert ticket.wait(5)
        elsewhere.end()
    assert elsewhere.cancelled == [True]
