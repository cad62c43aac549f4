# SPDX-License-Identifier: BSD-3-Clause
"""Systems and workers that end while others are at work."""

from __future__ import annotations

import contextlib
import threading

import pytest

from orbslam2py import Callbacks, KeyframeAdded, Sensor, StateError, System, WorkerError, _core
from orbslam2py._worker import WorkerState
from support.interleaving import LIMIT, Call, Stage, last_keyframe, refine
from support.scripts import run_to_the_end
from support.small_sequences import new_system, play, track
from support.watchdog import worker_threads

pytestmark = pytest.mark.watchdog(60)


# ---- shutdown ------------------------------------------------------------------------------------
@pytest.mark.parametrize("drain", [False, True])
@pytest.mark.parametrize(
    "verb", ["plan_loop_correction", "optimize_essential_graph", "apply_loop_correction"]
)
def test_shutdown_during_a_correction(slam: System, stage: Stage, verb: str, drain: bool) -> None:
    """The original's correction waits for the mapper, whether or not all is to end (OD-138)."""
    close = stage.loops(slam)
    gate = stage.gate(verb)
    apply = stage.gate("apply_loop_correction", opened=True) if "apply" not in verb else gate
    close(last_keyframe(slam))
    gate.wait_entered()
    finishing = stage.entering(slam.pipeline.back_end.loop_closing.worker, "finish")
    call = Call(slam.shutdown, drain=drain)
    assert finishing.wait(LIMIT)
    gate.open()
    call.result()
    assert worker_threads() == []
    applied = apply is gate or apply.is_entered(0)
    assert slam.n_loops_closed == int(applied)
    if drain:
        assert applied
    assert slam.check_map() == []


def test_shutdown_while_a_correction_waits_for_the_mapper(slam: System, stage: Stage) -> None:
    close = stage.loops(slam)
    points = stage.gate("create_new_points")
    stage._patch.setattr(_core, "process_new_keyframe", lambda *_: None)
    slam.pipeline.back_end.mapping.worker.submit(last_keyframe(slam))
    points.wait_entered()
    waiting = stage.entering(slam.pipeline.back_end.mapping.worker, "wait_until")
    close(last_keyframe(slam))
    assert waiting.wait(LIMIT)
    finishing = stage.entering(slam.pipeline.back_end.mapping.worker, "finish")
    call = Call(slam.shutdown, drain=False)
    assert finishing.wait(LIMIT)
    points.open()
    call.result()
    assert worker_threads() == []


def test_shutdown_gives_up_an_adjustment(slam: System, stage: Stage) -> None:
    """The original waits until it has been solved (OD-140)."""
    stage.waitable_cancel(slam.pipeline.back_end.adjustment.worker)
    solve = stage.endless_solve()
    refine(slam)
    solve.wait_entered()
    before = slam.map_hash()
    Call(slam.shutdown).result()
    assert slam.map_hash() == before
    assert [record.used for record in slam.full_adjustments] == [False]


def test_shutdown_waits_for_an_adjustment_when_asked_to(slam: System, stage: Stage) -> None:
    solve = stage.gate("solve_full_bundle")
    refine(slam)
    solve.wait_entered()
    finishing = stage.entering(slam.pipeline.back_end.adjustment.worker, "finish")
    call = Call(slam.shutdown, wait_for_adjustment=True)
    assert finishing.wait(LIMIT)
    solve.open()
    call.result()
    assert [record.used for record in slam.full_adjustments] == [True]


@pytest.mark.parametrize("drain", [False, True])
def test_shutdown_in_localization_mode(slam: System, stage: Stage, drain: bool) -> None:
    close = stage.loops(slam)
    slam.localization_mode = True
    track(slam, 30)
    close(last_keyframe(slam))
    Call(slam.shutdown, drain=drain).result()
    assert slam.n_loops_closed == int(drain), "what waits is done when it is to be drained"


def test_shutdown_while_a_reset_waits(slam: System, stage: Stage) -> None:
    close = stage.loops(slam)
    plan = stage.gate("plan_loop_correction")
    close(last_keyframe(slam))
    plan.wait_entered()
    slam.reset()
    waiting = stage.entering(slam.pipeline.back_end.loop_closing.worker, "wait_until")
    tracking = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    finishing = stage.entering(slam.pipeline.back_end.loop_closing.worker, "finish")
    ending = Call(slam.shutdown, drain=False)
    assert finishing.wait(LIMIT)
    plan.open()
    ending.result()
    try:
        tracking.result()
    except StateError as error:
        assert "shut down" in str(error)
    assert slam.n_resets == 1


@pytest.mark.parametrize("drain", [False, True])
def test_shutdown_in_two_threads_at_once(slam: System, stage: Stage, drain: bool) -> None:
    close = stage.loops(slam)
    plan = stage.gate("plan_loop_correction")
    close(last_keyframe(slam))
    plan.wait_entered()
    calls = []
    for _ in range(2):
        finishing = stage.entering(slam.pipeline.back_end.loop_closing.worker, "finish")
        calls.append(Call(slam.shutdown, drain=drain))
        assert finishing.wait(LIMIT)
    plan.open()
    for call in calls:
        call.result()
    assert worker_threads() == []


@pytest.mark.parametrize("drain", [False, True])
def test_shutdown_by_a_callback(drain: bool) -> None:
    """Which the thread of the callbacks cannot wait for."""
    ended = threading.Event()
    systems: list[System] = []
    tracked = threading.Event()

    def ends(_: KeyframeAdded) -> None:
        assert tracked.wait(LIMIT)
        systems.pop().shutdown(drain=drain)
        ended.set()

    system = new_system(Sensor.RGBD, callbacks=Callbacks(on_keyframe=ends))
    systems.append(system)
    track(system, 0)
    tracked.set()
    assert ended.wait(LIMIT)
    with pytest.raises(StateError, match="shut down"):
        track(system, 1)
    system.shutdown()


def test_optimize_ends_with_the_shutdown(slam: System, stage: Stage) -> None:
    stage.waitable_cancel(slam.pipeline.back_end.adjustment.worker)
    solve = stage.endless_solve()
    call = Call(slam.optimize)
    solve.wait_entered()
    slam.shutdown()
    assert not call.result().used


def test_the_interpreter_ends_while_an_adjustment_is_solved() -> None:
    code = (
        "import threading\n"
        "from orbslam2py import _core\n"
        "from support.small_sequences import new_system, play\n"
        "from orbslam2py import Sensor\n"
        "entered, real = threading.Event(), _core.solve_full_bundle\n"
        "def solve(bundle, options, cancelled, n_threads):\n"
        "    entered.set()\n"
        "    while not cancelled.is_set():\n"
        "        summary = real(bundle, options, cancelled, n_threads)\n"
        "    return summary\n"
        "_core.solve_full_bundle = solve\n"
        "system = new_system(Sensor.RGBD)\n"
        "play(system, 20)\n"
        "system.pipeline.back_end.adjustment.start()\n"
        "assert entered.wait(15)\n"
        "print('end')\n"
    )
    run_to_the_end(code, timeout=45)


# ---- workers that fail ---------------------------------------------------------------------------
def failing_end(system: System) -> None:
    """End a system one of whose workers has failed."""
    with pytest.raises(WorkerError):
        Call(system.shutdown).result()
    assert worker_threads() == []


def test_a_mapper_that_fails_lets_the_loop_closer_go_on(stage: Stage) -> None:
    system = new_system(Sensor.RGBD)
    play(system, 10)
    assert system.wait_until_idle(LIMIT)
    close = stage.loops(system)
    points = stage.gate("create_new_points")
    stage._patch.setattr(_core, "process_new_keyframe", lambda *_: None)
    system.pipeline.back_end.mapping.worker.submit(last_keyframe(system))
    points.wait_entered()
    waiting = stage.entering(system.pipeline.back_end.mapping.worker, "wait_until")
    close(last_keyframe(system))
    assert waiting.wait(LIMIT)
    points.error = RuntimeError("out of order")
    points.open()
    assert system.pipeline.back_end.loop_closing.worker.wait_until_idle(LIMIT)
    with pytest.raises(WorkerError, match="local mapping stopped: out of order"):
        track(system, 10)
    failing_end(system)


def test_a_loop_closer_that_fails_holds_nobody(stage: Stage) -> None:
    system = new_system(Sensor.RGBD)
    play(system, 10)
    assert system.wait_until_idle(LIMIT)
    close = stage.loops(system)
    apply = stage.gate("apply_loop_correction", opened=True)
    apply.error = RuntimeError("out of order")
    close(last_keyframe(system))
    with pytest.raises(WorkerError, match="loop closing stopped: out of order"):
        system.pipeline.back_end.loop_closing.worker.wait_until_idle(LIMIT)
    assert system.pipeline.back_end.loop_closing.worker.state is WorkerState.FAILED
    assert not system.pipeline.back_end.mapping.worker.pausing
    assert not system.pipeline.back_end.adjustment.worker.pausing
    with pytest.raises(WorkerError, match="out of order"):
        track(system, 10)
    failing_end(system)


@pytest.mark.parametrize("verb", ["solve_full_bundle", "commit_full_bundle"])
def test_an_adjustment_that_fails_reaches_those_who_wait(stage: Stage, verb: str) -> None:
    system = new_system(Sensor.RGBD)
    play(system, 10)
    gate = stage.gate(verb, opened=True)
    gate.error = RuntimeError("out of order")
    with pytest.raises(WorkerError, match="full bundle adjustment stopped: out of order"):
        Call(system.optimize).result()
    assert not system.pipeline.back_end.mapping.worker.pausing
    with pytest.raises(WorkerError, match="out of order"):
        track(system, 10)
    failing_end(system)


def test_tickets_of_a_failed_worker_do_not_wait(stage: Stage) -> None:
    """Nor does localization mode, which asks all of them."""
    system = new_system(Sensor.RGBD)
    play(system, 10)
    gate = stage.gate("solve_full_bundle", opened=True)
    gate.error = RuntimeError("out of order")
    refine(system)
    with pytest.raises(WorkerError):
        system.pipeline.back_end.adjustment.worker.wait_until_idle(LIMIT)
    released = threading.Event()
    with system.pipeline.back_end.adjustment.worker.pause() as ticket:
        assert ticket.wait(LIMIT)
        released.set()
    assert released.is_set()
    failing_end(system)


def test_no_adjustment_begins_while_the_system_ends(slam: System) -> None:
    """Loop closing may end later than it, and is not to fail for that."""
    adjustment = slam.pipeline.back_end.adjustment
    adjustment.worker.finish()
    adjustment.start()
    assert not adjustment.start_and_wait().used
    assert slam.full_adjustments == []


def test_shutdown_waits_for_an_image_in_another_thread(slam: System, stage: Stage) -> None:
    """What settles the frames must not read one while it is tracked."""
    gate = stage.gate("select_local_map")
    call = Call(track, slam, 40)
    gate.wait_entered()
    with pytest.raises(WorkerError, match=r"tracking did not end within 0\.05 s"):
        slam.shutdown(timeout=0.05)
    gate.open()
    with contextlib.suppress(StateError):  # it may have become a keyframe that nobody maps
        call.result()
    slam.shutdown(timeout=30)
    assert worker_threads() == []
