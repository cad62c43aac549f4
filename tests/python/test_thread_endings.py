# SPDX-License-Identifier: BSD-3-Clause
"""Maps, keyframes, systems and workers that end while others are at work.

D14 and D17 with a number are defects of the original in spec 14, section 8, and 17, section 4.
"""

from __future__ import annotations

import threading

import pytest

from interleaving import LIMIT, Call, Stage, last_keyframe, refine, run_to_the_end, settle
from orbslam2py import _core
from orbslam2py.errors import StateError, WorkerError
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.events import Callbacks, KeyframeAdded
from orbslam2py.slam.records import TrackingState
from orbslam2py.slam.system import System
from orbslam2py.slam.worker import WorkerState
from small_sequences import black, new_system, play, track
from watchdog import worker_threads

pytestmark = pytest.mark.watchdog(60)

N_FRAMES = 30


# ---- reset ---------------------------------------------------------------------------------------
def test_a_reset_gives_up_an_adjustment_without_waiting_for_its_solver(
    slam: System, stage: Stage
) -> None:
    """D14-8, D17-6: the original's goes on in the destroyed map."""
    solve, commit = stage.gate("solve_full_bundle"), stage.gate("commit_full_bundle")
    refine(slam)
    solve.wait_entered()
    slam.reset()
    assert Call(track, slam, 30).result().map_index == 1
    solve.open()
    settle(slam)
    assert not commit.is_entered(0)
    assert [record.used for record in slam.full_adjustments] == [False]


def test_a_reset_gives_up_an_adjustment_that_localization_mode_holds(
    slam: System, stage: Stage
) -> None:
    solve, commit = stage.gate("solve_full_bundle"), stage.gate("commit_full_bundle")
    refine(slam)
    solve.wait_entered()
    slam.localization_mode = True
    track(slam, 30)
    solve.open()
    slam.reset()
    assert Call(track, slam, 31).result().map_index == 1
    slam.localization_mode = False
    track(slam, 32)
    settle(slam)
    assert not commit.is_entered(0)


@pytest.mark.parametrize(
    "verb", ["plan_loop_correction", "optimize_essential_graph", "apply_loop_correction"]
)
def test_a_reset_during_a_correction(slam: System, stage: Stage, verb: str) -> None:
    """D14-8: the original's loop closer keeps keyframes of the old map."""
    close = stage.loops(slam)
    closing = slam._back_end.loop_closing
    gate = stage.gate(verb)
    close(last_keyframe(slam))
    gate.wait_entered()
    waiting = stage.entering(closing.worker, "wait_until")
    slam.reset()
    call = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    assert call.running, "the correction works on the map"
    gate.open()
    assert call.result().map_index == 1
    settle(slam)
    assert closing._next_search == 1
    assert closing.map_index == 1
    assert {loop.map_index for loop in slam.loops} <= {0}
    assert all(record.map_index == 0 for record in slam.full_adjustments if record.used)


def test_a_reset_of_a_spoilt_beginning_while_an_adjustment_is_written(stage: Stage) -> None:
    """D17-3: the original resets inside a frame, with the lock that the adjustment waits for."""
    with new_system(Sensor.RGBD) as system:
        play(system, 5)
        assert system.wait_until_idle(LIMIT)
        commit = stage.gate("commit_full_bundle")
        stage._patch.setattr(
            _core,
            "solve_full_bundle",
            lambda *_: SimpleSummary(),
        )
        refine(system)
        commit.wait_entered()
        lost = Call(track, system, 5, shown=black(Sensor.RGBD)).result()
        assert lost.state is TrackingState.LOST, "the frame waits for nobody"
        waiting = stage.entering(system._back_end.adjustment.worker, "wait_until")
        call = Call(track, system, 6)
        assert waiting.wait(LIMIT)
        commit.open()
        assert call.result().map_index == 1
        settle(system)


class SimpleSummary:
    """Of an adjustment that is said to have been solved."""

    aborted = False
    iterations = 1
    initial_cost = final_cost = 1.0


def test_optimize_ends_when_a_reset_drops_it(slam: System) -> None:
    """Before it has begun, and though none has been made before."""
    adjustment = slam._back_end.adjustment
    with adjustment.worker.pause(brief=True):
        call = Call(slam.optimize)
        slam.reset()
        track(slam, 30)
        record = call.result()
    assert not record.used
    assert slam.full_adjustments == []


def test_nobody_waits_for_those_who_look(slam: System, stage: Stage) -> None:
    """D17-5: the original's reset waits for a viewer that may have ended; and the other way."""
    close = stage.loops(slam)
    plan = stage.gate("plan_loop_correction")
    close(last_keyframe(slam))
    plan.wait_entered()
    waiting = stage.entering(slam._back_end.loop_closing.worker, "wait_until")
    slam.reset()
    call = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    for look in (slam.map_snapshot, slam.trajectory, slam.keyframe_trajectory, slam.map_hash):
        Call(look).result()
    plan.open()
    call.result()


def test_every_system_counts_its_own_changes(slam: System) -> None:
    """D17-13: the original counts in a variable of the process."""
    with new_system(Sensor.RGBD) as other:
        play(other, 5)
        assert slam.optimize().used
        assert slam._map.big_change_index == 1
        assert other._map.big_change_index == 0
    slam.reset()
    track(slam, 30)
    assert slam._map.big_change_index == 0


# ---- keyframes that die --------------------------------------------------------------------------
def test_a_keyframe_that_dies_in_the_loop_closers_queue_is_passed_over(slam: System) -> None:
    """D14-14: the original does not look."""
    closing = slam._back_end.loop_closing
    dies = last_keyframe(slam)
    slam._back_end.index.erase(dies)
    with closing.worker.pause() as ticket:
        assert ticket.wait(LIMIT)
        closing.worker.submit(dies)
        assert slam._map.erase_keyframe(dies)
    settle(slam)
    assert closing.last_keyframe == dies
    assert dies not in slam._back_end.index


def test_a_keyframe_culled_while_the_loop_closer_looks_at_it_dies_afterwards(
    slam: System, stage: Stage
) -> None:
    closing, index = slam._back_end.loop_closing, slam._back_end.index
    dies = last_keyframe(slam)
    index.erase(dies)
    gate = stage.gate("index_keyframe")
    closing.worker.submit(dies)
    gate.wait_entered()
    assert not slam._map.erase_keyframe(dies), "the lease protects it"
    assert slam._map.has_keyframe(dies)
    gate.open()
    settle(slam)
    assert not slam._map.has_keyframe(dies)
    assert dies not in index, "nobody finds it any more"


def test_related_keyframes_die_in_two_threads_at_once(slam: System) -> None:
    """D17-4: the original takes their two locks in opposite order."""
    keyframes = slam._map.keyframe_ids()[1:].tolist()

    def erase(order: list[int]) -> None:
        for keyframe in order:
            slam._map.erase_keyframe(keyframe)

    calls = [Call(erase, keyframes), Call(erase, keyframes[::-1])]
    for call in calls:
        call.result()
    assert slam._map.keyframe_ids().tolist() == [0]
    assert slam.check_map() == []


# ---- shutdown ------------------------------------------------------------------------------------
@pytest.mark.parametrize("drain", [False, True])
@pytest.mark.parametrize(
    "verb", ["plan_loop_correction", "optimize_essential_graph", "apply_loop_correction"]
)
def test_shutdown_during_a_correction(slam: System, stage: Stage, verb: str, drain: bool) -> None:
    """D14-4: the original's correction waits without looking at the end."""
    close = stage.loops(slam)
    gate = stage.gate(verb)
    apply = stage.gate("apply_loop_correction", opened=True) if "apply" not in verb else gate
    close(last_keyframe(slam))
    gate.wait_entered()
    finishing = stage.entering(slam._back_end.loop_closing.worker, "finish")
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
    slam._mapping.worker.submit(last_keyframe(slam))
    points.wait_entered()
    waiting = stage.entering(slam._mapping.worker, "wait_until")
    close(last_keyframe(slam))
    assert waiting.wait(LIMIT)
    finishing = stage.entering(slam._mapping.worker, "finish")
    call = Call(slam.shutdown, drain=False)
    assert finishing.wait(LIMIT)
    points.open()
    call.result()
    assert worker_threads() == []


def test_shutdown_gives_up_an_adjustment(slam: System, stage: Stage) -> None:
    """D14-17: the original waits for its end."""
    stage.waitable_cancel(slam._back_end.adjustment.worker)
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
    finishing = stage.entering(slam._back_end.adjustment.worker, "finish")
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
    waiting = stage.entering(slam._back_end.loop_closing.worker, "wait_until")
    tracking = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    finishing = stage.entering(slam._back_end.loop_closing.worker, "finish")
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
        finishing = stage.entering(slam._back_end.loop_closing.worker, "finish")
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
    stage.waitable_cancel(slam._back_end.adjustment.worker)
    solve = stage.endless_solve()
    call = Call(slam.optimize)
    solve.wait_entered()
    slam.shutdown()
    assert not call.result().used


def test_the_interpreter_ends_while_an_adjustment_is_solved() -> None:
    code = (
        "import threading\n"
        "from orbslam2py import _core\n"
        "from small_sequences import new_system, play\n"
        "from orbslam2py.settings.sensor import Sensor\n"
        "entered, real = threading.Event(), _core.solve_full_bundle\n"
        "def solve(bundle, options, cancelled, n_threads):\n"
        "    entered.set()\n"
        "    while not cancelled.is_set():\n"
        "        summary = real(bundle, options, cancelled, n_threads)\n"
        "    return summary\n"
        "_core.solve_full_bundle = solve\n"
        "system = new_system(Sensor.RGBD)\n"
        "play(system, 20)\n"
        "system._back_end.adjustment.start()\n"
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
    system._mapping.worker.submit(last_keyframe(system))
    points.wait_entered()
    waiting = stage.entering(system._mapping.worker, "wait_until")
    close(last_keyframe(system))
    assert waiting.wait(LIMIT)
    points.error = RuntimeError("out of order")
    points.open()
    assert system._back_end.loop_closing.worker.wait_until_idle(LIMIT)
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
        system._back_end.loop_closing.worker.wait_until_idle(LIMIT)
    assert system._back_end.loop_closing.worker.state is WorkerState.FAILED
    assert not system._mapping.worker.pausing
    assert not system._back_end.adjustment.worker.pausing
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
    assert not system._mapping.worker.pausing
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
        system._back_end.adjustment.worker.wait_until_idle(LIMIT)
    released = threading.Event()
    with system._back_end.adjustment.worker.pause() as ticket:
        assert ticket.wait(LIMIT)
        released.set()
    assert released.is_set()
    failing_end(system)
