# SPDX-License-Identifier: BSD-3-Clause
"""Workers: resets, and the end in every state."""

from __future__ import annotations

import pytest

from orbslam2py import Sensor, StateError, WorkerError
from orbslam2py._worker import Worker, WorkerState
from support.interleaving import LIMIT
from support.small_sequences import new_system, play
from support.worker_steps import NAME, Gate, eventually, once

pytestmark = pytest.mark.watchdog(10)


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
    once(worker.cancel_flag.is_set, gate.open)
    worker.reset(10)
    assert gate.done == [0]
    assert worker.idle
    assert not worker.waiting_flag.is_set()
    worker.submit(7)
    assert worker.wait_until_idle(10)
    assert gate.done == [0, 7]


def test_reset_while_paused(worker: Worker[int], gate: Gate) -> None:
    """The original's reset of a stopped mapper waits for ever (OD-121)."""
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


def test_work_that_nobody_misses_is_refused_quietly_after_the_end(worker: Worker[int]) -> None:
    worker.finish(timeout=10)
    assert worker.offer(1) is False
    with pytest.raises(StateError, match="has been shut down"):
        worker.submit(1)


def test_mapping_may_end_after_loop_closing() -> None:
    """A shutdown that ran out of time is repeated: the last keyframe finds loops closed no more."""
    system = new_system(Sensor.RGBD, wait_for_mapping=True)
    play(system, 5)
    back_end = system.pipeline.back_end
    assert system.wait_until_idle(LIMIT)
    back_end.loop_closing.worker.finish(timeout=LIMIT)
    newest = int(system.map_snapshot().keyframe_ids[-1])
    back_end.mapping.on_done(newest)
    system.shutdown(timeout=LIMIT)
