# SPDX-License-Identifier: BSD-3-Clause
"""Workers: order, pauses, resets, ends in every state, failures."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from orbslam2py.errors import OrbSlamError, StateError, WorkerError
from orbslam2py.slam.worker import CallGuard, Worker, WorkerState

pytestmark = pytest.mark.watchdog(10)

NAME = "worker under test"


class Gate:
    """A step that stops at every job until it is let through."""

    def __init__(self) -> None:
        self.begun: list[int] = []
        self.done: list[int] = []
        self.entered = threading.Semaphore(0)
        self.through = threading.Semaphore(0)

    def __call__(self, job: int) -> None:
        self.begun.append(job)
        self.entered.release()
        assert self.through.acquire(timeout=15)
        self.done.append(job)

    def wait_begun(self) -> None:
        assert self.entered.acquire(timeout=15)

    def open(self, times: int = 1000) -> None:
        for _ in range(times):
            self.through.release()


@pytest.fixture
def gate() -> Gate:
    return Gate()


@pytest.fixture
def worker(gate: Gate) -> Iterator[Worker[int]]:
    worker = Worker(NAME, gate, threaded=True)
    worker.start()
    yield worker
    gate.open()
    worker.finish(timeout=10)


def eventually(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < end, "did not happen"
        time.sleep(0.001)


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
    threading.Timer(0.05, gate.open).start()
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


# ---- pauses --------------------------------------------------------------------------------------
def test_pauses_are_counted(worker: Worker[int], gate: Gate) -> None:
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


# ---- reset ---------------------------------------------------------------------------------------
def test_reset_while_idle(worker: Worker[int], gate: Gate) -> None:
    worker.reset(10)
    gate.open()
    worker.submit(0)
    assert worker.wait_until_idle(10)
    assert gate.done == [0]


def test_reset_while_busy_waits_for_the_job_and_drops_the_others(
    worker: Worker[int], gate: Gate
) -> None:
    for job in range(3):
        worker.submit(job)
    gate.wait_begun()
    threading.Timer(0.05, gate.open).start()
    worker.reset(10)
    assert gate.done == [0]
    assert worker.idle
    assert not worker.waiting_flag.is_set()
    worker.submit(7)
    assert worker.wait_until_idle(10)
    assert gate.done == [0, 7]


def test_reset_while_paused(worker: Worker[int], gate: Gate) -> None:
    gate.open()
    with worker.pause():
        worker.submit(0)
        worker.reset(10)
        assert worker.n_waiting == 0
        worker.submit(1)
    assert worker.wait_until_idle(10)
    assert gate.done == [1]


def test_reset_names_a_worker_that_does_not_answer(worker: Worker[int], gate: Gate) -> None:
    worker.submit(0)
    gate.wait_begun()
    with pytest.raises(WorkerError, match=f"{NAME} did not acknowledge the reset"):
        worker.reset(0.05)


# ---- the end in every state ----------------------------------------------------------------------
@pytest.mark.parametrize("drain", [False, True])
def test_finish_before_start(drain: bool) -> None:
    worker = Worker(NAME, lambda _: None, threaded=True)
    worker.submit(0)
    worker.finish(drain=drain)
    assert worker.state is WorkerState.FINISHED


@pytest.mark.parametrize("drain", [False, True])
def test_finish_while_paused_does_not_wait_for_the_ticket(gate: Gate, drain: bool) -> None:
    gate.open()
    worker = Worker(NAME, gate, threaded=True)
    worker.start()
    ticket = worker.pause()
    worker.submit(0)
    worker.finish(drain=drain)
    assert gate.done == []
    ticket.release()


@pytest.mark.parametrize("drain", [False, True])
def test_finish_twice(worker: Worker[int], gate: Gate, drain: bool) -> None:
    gate.open()
    worker.submit(0)
    worker.finish(drain=drain, timeout=10)
    worker.finish(drain=drain, timeout=10)
    with pytest.raises(StateError, match="shut down"):
        worker.submit(1)


def test_finish_says_who_is_late_and_can_be_repeated(gate: Gate) -> None:
    worker = Worker(NAME, gate, threaded=True)
    worker.start()
    worker.submit(0)
    gate.wait_begun()
    with pytest.raises(WorkerError, match=f"{NAME} did not end within"):
        worker.finish(timeout=0.05)
    assert not worker.ended
    gate.open()
    worker.finish(timeout=10)
    assert worker.ended


def test_drain_gives_up_at_its_time_limit(gate: Gate) -> None:
    worker = Worker(NAME, gate, threaded=True)
    worker.start()
    worker.submit(0)
    worker.submit(1)
    gate.wait_begun()
    with pytest.raises(WorkerError, match="did not end"):
        worker.finish(drain=True, timeout=0.05)
    gate.open()
    worker.finish(timeout=10)
    assert gate.done == [0]


def test_finish_from_inside_the_step() -> None:
    worker: Worker[int] = Worker(NAME, lambda _: worker.finish(), threaded=True)
    worker.start()
    worker.submit(0)
    eventually(lambda: worker.state is WorkerState.FINISHED)
    worker.finish(timeout=10)


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


# ---- failures ------------------------------------------------------------------------------------
def failing(job: int) -> None:
    if job == 1:
        raise ValueError("bad job")


@pytest.fixture
def failed() -> Iterator[Worker[int]]:
    worker = Worker(NAME, failing, threaded=True)
    worker.start()
    worker.submit(0)
    assert worker.wait_until_idle(10)
    worker.submit(1)
    eventually(lambda: worker.state is WorkerState.FAILED)
    yield worker
    with pytest.raises(WorkerError):
        worker.finish(timeout=10)


@pytest.mark.parametrize(
    "call",
    [
        lambda worker: worker.submit(2),
        lambda worker: worker.raise_if_failed(),
        lambda worker: worker.wait_until_idle(10),
        lambda worker: worker.wait_until_waiting(at_most=0),
        lambda worker: worker.finish(drain=True, timeout=10),
        lambda worker: worker.finish(timeout=10),
    ],
    ids=["submit", "raise_if_failed", "wait_until_idle", "wait_until_waiting", "drain", "finish"],
)
def test_a_failure_arrives_with_its_cause(
    failed: Worker[int], call: Callable[[Worker[int]], object]
) -> None:
    for _ in range(2):  # and again: it is not forgotten
        with pytest.raises(WorkerError, match=f"{NAME} stopped: bad job") as caught:
            call(failed)
        assert isinstance(caught.value.__cause__, ValueError)


def test_failure_ends_those_who_wait() -> None:
    worker = Worker(NAME, failing, threaded=True)
    worker.start()
    with worker.pause():
        worker.submit(1)
        worker.submit(2)
        waiting = threading.Event()
        raised: list[BaseException] = []

        def wait() -> None:
            waiting.set()
            try:
                worker.wait_until_idle()
            except WorkerError as error:
                raised.append(error)

        thread = threading.Thread(target=wait)
        thread.start()
        assert waiting.wait(10)
    thread.join(10)
    assert not thread.is_alive()
    assert len(raised) == 1
    with pytest.raises(WorkerError):
        worker.finish(timeout=10)


def test_reset_of_a_failed_worker_does_not_wait(failed: Worker[int]) -> None:
    failed.reset(10)
    assert failed.state is WorkerState.FAILED, "a reset does not bring the thread back"


def test_exception_without_text_is_named() -> None:
    worker = Worker(NAME, lambda _: (_ for _ in ()).throw(KeyError()), threaded=False)
    with pytest.raises(WorkerError, match="KeyError"):
        worker.submit(0)


def test_failure_of_a_later_worker_keeps_the_original_cause() -> None:
    last = Worker("last", failing, threaded=False)
    first = Worker(NAME, last.submit, threaded=False)
    with pytest.raises(WorkerError, match="last stopped: bad job") as caught:
        first.submit(1)
    assert isinstance(caught.value.__cause__, ValueError)


# ---- inline --------------------------------------------------------------------------------------
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


# ---- guard and stress ----------------------------------------------------------------------------
def test_guard_allows_one_call_at_a_time() -> None:
    guard = CallGuard("tracking")
    with guard(), pytest.raises(StateError, match="tracking is already running"), guard():
        pass
    with pytest.raises(KeyError), guard():
        raise KeyError
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
