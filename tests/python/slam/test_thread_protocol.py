# SPDX-License-Identifier: BSD-3-Clause
"""Requests between threads, each in the interleaving in which the original hangs or goes wrong."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from orbslam2py import Sensor, StateError, System, TrackingState, _core
from support.interleaving import LIMIT, Call, Stage, last_keyframe, refine, settle
from support.small_sequences import new_system, play, track

pytestmark = pytest.mark.watchdog(60)

N_FRAMES = 30


# ---- mapping: its queue, its interrupt, its pauses -----------------------------------------------
def busy_mapping(stage: Stage) -> tuple[System, Callable[[], None], int]:
    """A system whose mapper is held at its first keyframe while others wait.

    Returns it, what lets the mapper go on, and the next frame.
    """
    gate = stage.gate("create_new_points")
    system = new_system(Sensor.RGBD)
    track(system, 0)
    gate.wait_entered()
    frame = 1
    while system.pipeline.back_end.mapping.worker.n_waiting == 0:
        assert frame < 60, "the tracker inserts keyframes while the mapper is busy"
        track(system, frame)
        frame += 1
    return system, gate.open, frame


def test_waiting_keyframes_outlive_localization_mode(stage: Stage) -> None:
    """In the original the mapper's release deletes the keyframes that wait for it (OD-126)."""
    system, go_on, frame = busy_mapping(stage)
    with system:
        inserted = len(system.pipeline.back_end.map.keyframe_ids())
        system.localization_mode = True
        waiting = stage.entering(system.pipeline.back_end.mapping.worker, "wait_until")
        call = Call(track, system, frame)
        assert waiting.wait(LIMIT)
        go_on()
        call.result()
        assert system.pipeline.back_end.mapping.worker.n_waiting >= 1
        system.localization_mode = False
        track(system, frame + 1)
        settle(system)
        assert system.n_keyframes >= inserted


def test_a_new_keyframe_interrupts_local_bundle_adjustment(
    slam: System, stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a flag that the original writes from three threads without a lock (OD-127)."""
    mapping = slam.pipeline.back_end.mapping.worker
    gate = stage.gate("local_bundle_adjustment")
    monkeypatch.setattr(_core, "process_new_keyframe", lambda *_: None)
    mapping.submit(1)
    gate.wait_entered()
    assert not mapping.interrupt_flag.is_set()
    mapping.submit(2)
    assert mapping.interrupt_flag.is_set()
    gate.open()
    settle(slam)


def test_an_idle_mapper_says_so_at_once(slam: System) -> None:
    """The original's looks busy for a part of every three milliseconds (OD-130)."""
    mapping = slam.pipeline.back_end.mapping.worker
    assert all(mapping.idle for _ in range(10000))


def test_no_keyframe_is_made_while_the_mapper_is_to_stand_still(slam: System) -> None:
    before = slam.pipeline.back_end.map.keyframe_ids().tolist()
    with slam.pipeline.back_end.mapping.worker.pause() as ticket:
        assert ticket.wait(LIMIT)
        records = play(slam, 40, first=N_FRAMES)
    assert not any(record.is_keyframe for record in records)
    assert slam.pipeline.back_end.map.keyframe_ids().tolist() == before


def test_keyframes_have_their_words_before_others_see_them(stage: Stage) -> None:
    """The original's tracker reads words while the mapper computes them (OD-128)."""
    real, described = _core.insert_keyframe, []

    def insert(world: _core.Map, frame: _core.TrackedFrame, **options: bool) -> int:
        described.append(frame.features.described)
        return int(real(world, frame, **options))

    stage._patch.setattr(_core, "insert_keyframe", insert)
    system, go_on, _ = busy_mapping(stage)
    go_on()
    with system:
        settle(system)
    assert len(described) >= 2
    assert all(described)


# ---- localization mode ---------------------------------------------------------------------------
def test_a_reset_is_served_while_localization_mode_holds_the_workers(slam: System) -> None:
    """The original's mapper does not look at resets while it stands: all wait for ever (OD-121)."""
    slam.localization_mode = True
    assert track(slam, 30).state is TrackingState.OK
    assert slam.pipeline.back_end.mapping.worker.held
    slam.reset()
    record = Call(track, slam, 31).result()
    assert (record.map_index, record.state) == (1, TrackingState.OK)
    assert slam.localization_mode, "the mode stays"
    play(slam, 3, first=32)
    assert slam.pipeline.back_end.mapping.worker.held, "and is in force again with the new map"


def test_localization_mode_waits_for_no_adjustment_that_is_being_solved(
    slam: System, stage: Stage
) -> None:
    """The map stays as it is until the mode ends; the adjustment is not lost."""
    solve, commit = stage.gate("solve_full_bundle"), stage.gate("commit_full_bundle")
    refine(slam)
    solve.wait_entered()
    slam.localization_mode = True
    assert Call(track, slam, 30).result().state is TrackingState.OK
    before = slam.map_hash()
    solve.open()
    play(slam, 5, first=31)
    assert not commit.is_entered(0.2)
    assert slam.map_hash() == before
    slam.localization_mode = False
    # The commit keeps the mapper, for which the image may wait.
    call = Call(track, slam, 36)
    commit.wait_entered()
    commit.open()
    call.result()
    settle(slam)
    assert [record.used for record in slam.full_adjustments] == [True]
    assert slam.map_hash() != before


@pytest.mark.parametrize("verb", ["plan_loop_correction", "apply_loop_correction"])
def test_a_loop_closed_at_the_switch_does_not_end_localization_mode(
    slam: System, stage: Stage, verb: str
) -> None:
    """In the original any release of the mapper cancels the mode (OD-129, OD-137)."""
    close = stage.loops(slam)
    gate = stage.gate(verb)
    close(last_keyframe(slam))
    gate.wait_entered()
    slam.localization_mode = True
    waiting = stage.entering(slam.pipeline.back_end.loop_closing.worker, "wait_until")
    call = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    gate.open()
    assert call.result().state is TrackingState.OK
    assert slam.n_loops_closed == 1
    assert slam.pipeline.back_end.mapping.worker.held
    before = slam.map_hash()
    records = play(slam, 20, first=31)
    assert not any(record.is_keyframe for record in records)
    assert slam.map_hash() == before


def test_an_adjustment_written_at_the_switch_does_not_end_localization_mode(
    slam: System, stage: Stage
) -> None:
    """In the original its end starts the mapper again, whatever the mode (OD-129, OD-137)."""
    commit = stage.gate("commit_full_bundle")
    refine(slam)
    commit.wait_entered()
    slam.localization_mode = True
    waiting = stage.entering(slam.pipeline.back_end.adjustment.worker, "wait_until")
    call = Call(track, slam, 30)
    assert waiting.wait(LIMIT)
    commit.open()
    assert call.result().state is TrackingState.OK
    assert slam.full_adjustments[-1].used
    assert slam.pipeline.back_end.mapping.worker.held
    before = slam.map_hash()
    play(slam, 5, first=31)
    assert slam.map_hash() == before


def test_a_keyframe_that_waits_for_the_loop_closer_outlives_localization_mode(
    slam: System, stage: Stage
) -> None:
    close = stage.loops(slam)
    slam.localization_mode = True
    track(slam, 30)
    close(last_keyframe(slam))
    assert track(slam, 31).state is TrackingState.OK
    assert slam.n_loops_closed == 0
    slam.localization_mode = False
    track(slam, 32)
    settle(slam)
    assert slam.n_loops_closed == 1


def test_optimize_ends_when_localization_mode_comes_on(slam: System, stage: Stage) -> None:
    """It would wait for the end of the mode otherwise."""
    stage.waitable_cancel(slam.pipeline.back_end.adjustment.worker)
    solve = stage.endless_solve()
    call = Call(slam.optimize)
    solve.wait_entered()
    slam.localization_mode = True
    track(slam, 30)
    assert not call.result().used
    with pytest.raises(StateError, match="localization"):
        slam.optimize()


def test_who_waits_for_the_workers_is_told_when_localization_mode_comes_on(
    slam: System, stage: Stage
) -> None:
    """What has not been done by then may wait for long."""
    solve = stage.gate("solve_full_bundle")
    refine(slam)
    solve.wait_entered()
    call = Call(slam.wait_until_idle)
    slam.localization_mode = True
    track(slam, 30)
    assert call.result() is False
    solve.open()
    slam.localization_mode = False
    track(slam, 31)
    assert slam.wait_until_idle(LIMIT)


# ---- loops and full adjustments ------------------------------------------------------------------
def test_a_second_loop_gives_up_the_running_adjustment(slam: System, stage: Stage) -> None:
    """The original's clears the flag that stops the first: its stale result is written (OD-136)."""
    close = stage.loops(slam)
    solve = stage.gate("solve_full_bundle")
    close(last_keyframe(slam) - 1)
    solve.wait_entered()
    close(last_keyframe(slam))
    assert slam.pipeline.back_end.loop_closing.worker.wait_until_idle(LIMIT), (
        "nobody waits for the first"
    )
    assert slam.n_loops_closed == 2
    solve.open()
    settle(slam)
    assert [record.used for record in slam.full_adjustments] == [False, True]


def test_a_loop_begins_while_an_adjustment_is_written(slam: System, stage: Stage) -> None:
    """The original's adjustment lets the mapper go, and the loop waits for it for ever (OD-122)."""
    close = stage.loops(slam)
    commit, plan = stage.gate("commit_full_bundle"), stage.gate("plan_loop_correction")
    plan.open()
    refine(slam)
    commit.wait_entered()
    waiting = stage.entering(slam.pipeline.back_end.adjustment.worker, "reset")
    close(last_keyframe(slam))
    assert waiting.wait(LIMIT)
    assert slam.pipeline.back_end.mapping.worker.pausing
    commit.open()
    settle(slam)
    assert slam.n_loops_closed == 1
    assert stage.journal.index("commit_full_bundle ends") < stage.journal.index(
        "plan_loop_correction begins"
    )
    assert not slam.pipeline.back_end.mapping.worker.pausing


def test_no_adjustment_is_written_in_the_middle_of_a_correction(slam: System, stage: Stage) -> None:
    """The correction would undo it, and leave points behind."""
    close = stage.loops(slam)
    graph, commit = stage.gate("optimize_essential_graph"), stage.gate("commit_full_bundle")
    apply = stage.gate("apply_loop_correction", opened=True)
    close(last_keyframe(slam))
    graph.wait_entered()
    call = Call(slam.optimize)
    assert not commit.is_entered(0.3)
    graph.open()
    apply.wait_entered()
    commit.open()
    call.result()
    settle(slam)
    assert stage.journal.index("apply_loop_correction ends") < stage.journal.index(
        "commit_full_bundle begins"
    )


def test_an_adjustment_that_a_loop_overtook_is_not_written(
    slam: System, stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even if nobody told it: the map has moved as a whole since, its result is stale (OD-136)."""
    solve = stage.gate("solve_full_bundle")
    refine(slam)
    solve.wait_entered()
    slam.pipeline.back_end.map.count_big_change()
    before = slam.map_hash()
    solve.open()
    settle(slam)
    assert [record.used for record in slam.full_adjustments] == [False]
    assert slam.map_hash() == before


def test_corrections_do_not_disturb_each_other(slam: System, stage: Stage) -> None:
    """A loop's adjustment, another loop and requests of the user, all at once."""
    close = stage.loops(slam)
    calls = [Call(slam.optimize) for _ in range(3)]
    for keyframe in slam.pipeline.back_end.map.keyframe_ids()[1:].tolist():
        close(keyframe)
    records = [call.result() for call in calls]
    settle(slam)
    assert len({id(record) for record in records}) == 3, "each call has its own"
    assert slam.n_loops_closed == len(slam.pipeline.back_end.map.keyframe_ids()) - 1
    assert slam.full_adjustments[-1].used
    assert not slam.pipeline.back_end.mapping.worker.pausing


def test_tracking_goes_on_while_an_adjustment_is_solved(slam: System, stage: Stage) -> None:
    solve = stage.gate("solve_full_bundle")
    refine(slam)
    solve.wait_entered()
    records = Call(play, slam, 40, N_FRAMES).result()
    assert all(record.state is TrackingState.OK for record in records)
    assert any(record.is_keyframe for record in records), "and mapping"
    assert slam.pipeline.back_end.mapping.worker.wait_until_idle(LIMIT)
    solve.open()
    settle(slam)
    assert slam.full_adjustments[-1].used, "what was made meanwhile follows"
