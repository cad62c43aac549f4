# SPDX-License-Identifier: BSD-3-Clause
"""Maps and keyframes that end while others are at work."""

from __future__ import annotations

import pytest

from orbslam2py import Sensor, System, TrackingState, _core
from support.interleaving import LIMIT, Call, Stage, last_keyframe, refine, settle
from support.small_sequences import elsewhere, new_system, play, track

pytestmark = pytest.mark.watchdog(60)


# ---- reset ---------------------------------------------------------------------------------------
def test_a_reset_gives_up_an_adjustment_without_waiting_for_its_solver(
    slam: System, stage: Stage
) -> None:
    """The original's goes on in the destroyed map (OD-139)."""
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
    """The original's loop closer keeps keyframes of the old map (OD-139)."""
    close = stage.loops(slam)
    closing = slam.pipeline.back_end.loop_closing
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
    assert slam.pipeline.back_end.map.epoch == 1
    assert {loop.map_index for loop in slam.loops} <= {0}
    assert all(record.map_index == 0 for record in slam.full_adjustments if record.used)


def test_a_reset_of_a_spoilt_beginning_while_an_adjustment_is_written(stage: Stage) -> None:
    """The original resets inside a frame, with the lock that the adjustment waits for (OD-123)."""
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
        lost = Call(track, system, 5, shown=elsewhere(Sensor.RGBD)).result()
        assert lost.state is TrackingState.LOST, "the frame waits for nobody"
        waiting = stage.entering(system.pipeline.back_end.adjustment.worker, "wait_until")
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
    adjustment = slam.pipeline.back_end.adjustment
    with adjustment.worker.pause(brief=True):
        call = Call(slam.optimize)
        slam.reset()
        track(slam, 30)
        record = call.result()
    assert not record.used
    assert slam.full_adjustments == []


def test_nobody_waits_for_those_who_look(slam: System, stage: Stage) -> None:
    """The original's reset waits for its viewer, for ever if that has ended (OD-125)."""
    close = stage.loops(slam)
    plan = stage.gate("plan_loop_correction")
    close(last_keyframe(slam))
    plan.wait_entered()
    waiting = stage.entering(slam.pipeline.back_end.loop_closing.worker, "wait_until")
    slam.reset()
    call = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    for look in (slam.map_snapshot, slam.trajectory, slam.keyframe_trajectory, slam.map_hash):
        Call(look).result()
    plan.open()
    call.result()


def test_every_system_counts_its_own_changes(slam: System) -> None:
    """The original counts in one variable for all systems of a process (OD-132)."""
    with new_system(Sensor.RGBD) as other:
        play(other, 5)
        assert slam.optimize().used
        assert slam.pipeline.back_end.map.big_change_index == 1
        assert other.pipeline.back_end.map.big_change_index == 0
    slam.reset()
    track(slam, 30)
    assert slam.pipeline.back_end.map.big_change_index == 0


# ---- keyframes that die --------------------------------------------------------------------------
def test_a_keyframe_that_dies_in_the_loop_closers_queue_is_passed_over(slam: System) -> None:
    """The original does not look whether it is still alive (OD-49, OD-96)."""
    closing = slam.pipeline.back_end.loop_closing
    dies = last_keyframe(slam)
    slam.pipeline.back_end.keyframe_index.erase(dies)
    with closing.worker.pause() as ticket:
        assert ticket.wait(LIMIT)
        closing.worker.submit(dies)
        assert slam.pipeline.back_end.map.erase_keyframe(dies)
    settle(slam)
    assert closing.last_keyframe == dies
    assert dies not in slam.pipeline.back_end.keyframe_index


def test_a_keyframe_culled_while_the_loop_closer_looks_at_it_dies_afterwards(
    slam: System, stage: Stage
) -> None:
    closing, index = slam.pipeline.back_end.loop_closing, slam.pipeline.back_end.keyframe_index
    dies = last_keyframe(slam)
    index.erase(dies)
    gate = stage.gate("index_keyframe")
    closing.worker.submit(dies)
    gate.wait_entered()
    assert not slam.pipeline.back_end.map.erase_keyframe(dies), "the lease protects it"
    assert slam.pipeline.back_end.map.has_keyframe(dies)
    gate.open()
    settle(slam)
    assert not slam.pipeline.back_end.map.has_keyframe(dies)
    assert dies not in index, "nobody finds it any more"


def test_related_keyframes_die_in_two_threads_at_once(slam: System) -> None:
    """The original takes their two locks in opposite order (OD-124)."""
    keyframes = slam.pipeline.back_end.map.keyframe_ids()[1:].tolist()

    def erase(order: list[int]) -> None:
        for keyframe in order:
            slam.pipeline.back_end.map.erase_keyframe(keyframe)

    calls = [Call(erase, keyframes), Call(erase, keyframes[::-1])]
    for call in calls:
        call.result()
    assert slam.pipeline.back_end.map.keyframe_ids().tolist() == [0]
    assert slam.check_map() == []
