# SPDX-License-Identifier: BSD-3-Clause
"""The life of a system: shutdown, reset, lost and found, failing workers."""

from __future__ import annotations

import gc
import threading
from typing import Any

import numpy as np
import pytest

from orbslam2py import (
    Callbacks,
    KeyframeAdded,
    MapFileError,
    Reason,
    Sensor,
    StateError,
    TrackingRecord,
    TrackingState,
    WorkerError,
    _core,
)
from support.scripts import run_to_the_end
from support.small_sequences import ate, black, elsewhere, new_system, play, sequence, track
from support.watchdog import worker_threads

pytestmark = pytest.mark.watchdog(30)


# ---- shutdown ------------------------------------------------------------------------------------
def test_shutdown_is_final_and_idempotent(sensor: Sensor) -> None:
    system = new_system(sensor)
    records = play(system, 20)
    system.shutdown()
    system.shutdown()
    with pytest.raises(StateError, match="shut down"):
        track(system, 20)
    assert len(system.trajectory()) == 20
    assert system.n_keyframes >= 1
    assert system.check_map() == []
    assert system.state is records[-1].state


def test_shutdown_without_images(sensor: Sensor) -> None:
    system = new_system(sensor)
    system.shutdown()
    assert len(system.trajectory()) == 0
    assert len(system.keyframe_trajectory()) == 0
    assert system.map_snapshot().point_positions.shape == (0, 3)
    assert system.stage_statistics() == {}


def test_a_map_that_never_began() -> None:
    """It looked like one that is empty."""
    with new_system(Sensor.STEREO, deterministic=True) as system:
        for number, told in ((5, "there is no map 5; 1 has begun so far"), (-1, "no map -1")):
            for ask in (system.keyframe_trajectory, system.map_snapshot):
                with pytest.raises(IndexError, match=told) as caught:
                    ask(number)
                assert "give a number of those in System.maps, or None" in str(caught.value)
        for ask in (system.keyframe_trajectory, system.map_snapshot):
            with pytest.raises(StateError, match="the number of the map is 'first'; give"):
                ask("first")  # type: ignore[arg-type]
        play(system, 3)
        assert len(system.keyframe_trajectory(0)) == 1
        assert system.map_snapshot(0) == system.map_snapshot()
        system.reset()
        track(system, 3)
        assert len(system.map_snapshot(0).keyframe_ids) == 0, "nothing is left of one that ended"
        with pytest.raises(IndexError, match="there is no map 2; 2 have begun"):
            system.map_snapshot(2)


def test_shutdown_without_draining_interrupts_mapping() -> None:
    system = new_system(Sensor.STEREO)
    play(system, 30)
    system.shutdown(drain=False, timeout=20)
    assert len(system.trajectory()) == 30


def test_interrupted_shutdown_can_be_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    system = new_system(Sensor.RGBD)
    play(system, 3)
    with monkeypatch.context() as patch:
        patch.setattr(
            type(system.pipeline.back_end.mapping.worker),
            "finish",
            lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt),
        )
        with pytest.raises(KeyboardInterrupt):
            system.shutdown()
    with pytest.raises(StateError):
        track(system, 3)
    system.shutdown()
    assert worker_threads() == []


def test_dropped_system_ends_its_threads() -> None:
    """The original's are never joined (OD-133)."""
    system = new_system(Sensor.RGBD)
    play(system, 10)
    assert {"local mapping", "loop closing"} <= set(worker_threads())
    del system
    gc.collect()
    assert worker_threads() == []


def test_error_of_the_caller_passes_through() -> None:
    with pytest.raises(ZeroDivisionError), new_system(Sensor.RGBD) as system:
        play(system, 5)
        _ = 1 / 0
    assert worker_threads() == []
    assert len(system.trajectory()) == 5


def test_interpreter_ends_without_shutdown() -> None:
    code = (
        "from support.small_sequences import new_system, play\n"
        "from orbslam2py import Sensor\n"
        "system = new_system(Sensor.STEREO)\n"
        "play(system, 12)\n"
        "print('end')\n"
    )
    run_to_the_end(code, timeout=25)


# ---- reset ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("deterministic", [True, False])
def test_reset_while_ok_keeps_the_earlier_map(sensor: Sensor, deterministic: bool) -> None:
    with new_system(sensor, deterministic=deterministic) as system:
        play(system, 20)
        before = system.trajectory()
        system.reset()
        assert len(system.trajectory()) == 20, "carried out at the next call"
        record = track(system, 20)
        assert (record.frame_id, record.map_index, record.is_keyframe) == (0, 1, True)
        play(system, 10, first=21)
        earlier, present = system.trajectories()
        assert system.n_resets == 1
        assert system.check_map() == []
    np.testing.assert_array_equal(earlier.timestamps, before.timestamps)
    assert len(present) == 11
    assert present.timestamps[0] == sequence(sensor).timestamps[20]
    np.testing.assert_array_equal(present.indices, np.arange(11))


def test_reset_before_the_first_image(sensor: Sensor) -> None:
    with new_system(sensor) as system:
        system.reset()
        assert track(system, 0).state is TrackingState.OK
        assert len(system.trajectory()) == 1


def test_deterministic_run_after_a_reset_equals_a_fresh_one() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        play(system, 25)
        system.reset()
        play(system, 20, first=25)
    with new_system(Sensor.STEREO, deterministic=True) as fresh:
        play(fresh, 20, first=25)
    assert system.map_hash() == fresh.map_hash()
    np.testing.assert_array_equal(system.trajectory().T_wc, fresh.trajectory().T_wc)


@pytest.mark.parametrize("deterministic", [True, False])
def test_lost_and_found_again(sensor: Sensor, deterministic: bool) -> None:
    with new_system(sensor, deterministic=deterministic, wait_for_mapping=True) as system:
        play(system, 75, settled=True)
        assert system.n_keyframes > 5, "a smaller map would be given up"
        reasons = {75: Reason.FEW_MATCHES_REFERENCE, 76: Reason.NOT_FOUND_IN_MAP}
        for i, reason in reasons.items():
            record = track(system, i, shown=black(sensor))
            assert record.state is system.state is TrackingState.LOST
            assert record.reason is reason
            assert record.T_cw is None
            assert record.T_wc is None
            assert record.covariance is None
            assert record.n_inliers == 0
        assert system.n_relocalizations == 0
        found = play(system, 3, first=77)
        assert [r.state for r in found] == [TrackingState.OK] * 3
        assert found[0].map_index == 0
        assert system.n_relocalizations == 1
    trajectory = system.trajectory()
    assert len(trajectory) == 80
    assert np.flatnonzero(trajectory.lost).tolist() == [75, 76]
    assert ate(system) < 0.05


def test_reset_while_lost(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 75)
        assert track(system, 75, shown=black(sensor)).state is TrackingState.LOST
        assert system.n_resets == 0
        system.reset()
        record = track(system, 76)
        assert record.state is TrackingState.OK
        assert record.map_index == 1
        assert [len(t) for t in system.trajectories()] == [76, 1]


def test_a_young_map_is_given_up_when_lost(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 5)
        assert track(system, 5, shown=elsewhere(sensor)).state is TrackingState.LOST
        record = track(system, 6, shown=black(sensor))
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason is Reason.TOO_FEW_KEYPOINTS
        assert record.map_index == 1
        assert track(system, 7).state is TrackingState.OK
        assert system.n_resets == 1
        assert [len(t) for t in system.trajectories()] == [5, 1]


@pytest.mark.parametrize("moment", ["while it is lost", "while it is given up"])
def test_a_reset_is_more_than_giving_up_a_young_map(
    moment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever asks first: time stamps and sizes may be others after a reset."""
    with new_system(Sensor.MONOCULAR, deterministic=True) as system:
        records: list[TrackingRecord] = []
        while system.n_keyframes < 4:
            records += play(system, 1, first=len(records))
        assert records[-1].state is TrackingState.OK
        assert system.n_keyframes <= 5, "the map is given up when it is lost"
        pipeline = system.pipeline
        if moment == "while it is lost":
            keep = pipeline._keep

            def reset_and_keep(*arguments: Any) -> None:
                system.reset()
                keep(*arguments)

            monkeypatch.setattr(pipeline, "_keep", reset_and_keep)
            assert (
                track(system, len(records), shown=elsewhere(Sensor.MONOCULAR)).state
                is TrackingState.LOST
            )
            monkeypatch.undo()
        else:
            assert (
                track(system, len(records), shown=elsewhere(Sensor.MONOCULAR)).state
                is TrackingState.LOST
            )
            end = pipeline.recorder.end_maps

            def end_and_reset() -> None:
                end()
                system.reset()

            monkeypatch.setattr(pipeline.recorder, "end_maps", end_and_reset)
            track(system, len(records) + 1)
            monkeypatch.undo()
        first = track(system, 0, timestamp=0.0)
        assert first.frame_id == 0


def test_a_reset_that_fails_is_carried_out_later(monkeypatch: pytest.MonkeyPatch) -> None:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        play(system, 5)
        system.reset()

        def interrupted() -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(system.pipeline.recorder, "end_maps", interrupted)
        with pytest.raises(KeyboardInterrupt):
            track(system, 5)
        monkeypatch.undo()
        assert track(system, 0, timestamp=0.0).frame_id == 0
        assert system.n_resets == 1


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"map_index": "0"}, StateError, "the number of the map is '0'; give a number of those"),
        ({"map_index": 1.5}, StateError, r"the number of the map is 1\.5"),
        ({"map_index": -1}, IndexError, "there is no map -1; 1 has begun so far"),
        ({"map_index": 2**70}, IndexError, "there is no map 1180591620717411303424"),
        ({"stop": 5}, StateError, r"stop is 5; give a threading\.Event"),
    ],
)
def test_optimize_refuses_what_it_cannot_do_and_goes_on(
    arguments: dict[str, Any], error: type[Exception], says: str
) -> None:
    with new_system(Sensor.STEREO) as system:
        play(system, 5)
        with pytest.raises(error, match=says):
            system.optimize(**arguments)
        assert system.optimize(map_index=0).map_index == 0
        assert track(system, 5).state is TrackingState.OK


def test_a_callback_may_wait_for_another_thread_that_calls_the_system() -> None:
    """Also in the deterministic mode, where it is called within a step."""
    used: list[bool] = []

    def refine(_: KeyframeAdded) -> None:
        if system.n_keyframes == 3 and not used:
            thread = threading.Thread(target=lambda: used.append(system.optimize().used))
            thread.start()
            thread.join()

    heard: list[object] = []
    callbacks = Callbacks(on_keyframe=refine, on_map_change=heard.append)
    with new_system(Sensor.STEREO, deterministic=True, callbacks=callbacks) as system:
        records = play(system, 30)
        assert {record.state for record in records} == {TrackingState.OK}
        assert system.check_map() == []
    assert len(used) == 1
    assert len(heard) == sum(used)


def test_shutdown_in_another_thread_while_a_callback_lasts() -> None:
    entered, leave = threading.Event(), threading.Event()

    def last(_: KeyframeAdded) -> None:
        entered.set()
        assert leave.wait(20)

    callbacks = Callbacks(on_keyframe=last)
    system = new_system(Sensor.STEREO, deterministic=True, callbacks=callbacks)
    thread = threading.Thread(target=play, args=(system, 1))
    thread.start()
    assert entered.wait(20)
    with pytest.raises(WorkerError, match=r"did not end within 0\.1 s"):
        system.shutdown(timeout=0.1)
    leave.set()
    thread.join(20)
    system.shutdown(timeout=20)


def test_optimize_in_another_thread_beside_a_deterministic_run() -> None:
    """Workers without threads take turns."""
    stop = threading.Event()
    errors: list[Exception] = []
    with new_system(Sensor.STEREO, deterministic=True) as system:
        play(system, 5)

        def refine() -> None:
            try:
                while not stop.is_set():
                    system.optimize()
            except Exception as error:
                errors.append(error)

        thread = threading.Thread(target=refine)
        thread.start()
        try:
            records = play(system, 30, first=5)
        finally:
            stop.set()
            thread.join(30)
        assert errors == []
        assert {record.state for record in records} == {TrackingState.OK}
        assert len(system.full_adjustments) > 0
        assert system.check_map() == []


def test_a_young_map_outlives_the_dark(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 5)
        for i in (5, 6):
            assert track(system, i, shown=black(sensor)).state is TrackingState.LOST
        record = track(system, 7)
        assert (record.state, record.map_index) == (TrackingState.OK, 0)
        assert system.n_resets == 0
        assert [len(t) for t in system.trajectories()] == [8]


# ---- a worker that fails -------------------------------------------------------------------------
class BrokenError(RuntimeError):
    """Thrown into a worker."""


def breaks(*_: object, **__: object) -> None:
    raise BrokenError("out of order")


@pytest.mark.parametrize("deterministic", [True, False])
@pytest.mark.parametrize("verb", ["process_new_keyframe", "create_new_points", "cull_keyframes"])
def test_failed_mapping_reaches_the_caller(
    monkeypatch: pytest.MonkeyPatch, deterministic: bool, verb: str
) -> None:
    """As an exception of the next call, not as the end of the process (OD-134)."""
    system = new_system(Sensor.RGBD, deterministic=deterministic)
    play(system, 10)
    system.wait_until_idle(20)
    monkeypatch.setattr(_core, verb, breaks)
    with pytest.raises(WorkerError, match="local mapping stopped: out of order") as caught:
        play(system, 60, first=10, settled=True)
    assert isinstance(caught.value.__cause__, BrokenError)
    with pytest.raises(WorkerError):
        track(system, 79)
    with pytest.raises(WorkerError) as caught:
        system.shutdown(timeout=20)
    assert isinstance(caught.value.__cause__, BrokenError)
    system.shutdown()
    assert len(system.trajectory()) >= 10, "what was tracked is not lost"


@pytest.mark.parametrize("deterministic", [True, False])
def test_failed_loop_closing_reaches_the_caller(
    monkeypatch: pytest.MonkeyPatch, deterministic: bool
) -> None:
    system = new_system(Sensor.RGBD, deterministic=deterministic)
    monkeypatch.setattr(system.pipeline.back_end.loop_closing.worker, "_step", breaks)
    with pytest.raises(WorkerError, match="loop closing stopped: out of order") as caught:
        play(system, 80)
        system.wait_until_idle(20)
    assert isinstance(caught.value.__cause__, BrokenError)
    with pytest.raises(WorkerError, match="loop closing stopped") as caught:
        system.shutdown(timeout=20)
    assert isinstance(caught.value.__cause__, BrokenError)


def test_failure_is_raised_at_the_end_of_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_core, "process_new_keyframe", breaks)
    with pytest.raises(WorkerError, match="out of order"), new_system(Sensor.RGBD) as system:
        track(system, 0)
    assert worker_threads() == []


def test_what_fails_after_a_worker_failed_in_the_block_is_logged(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def unsaved(*_: object) -> None:
        raise MapFileError("the disk is full")

    system = new_system(Sensor.RGBD, deterministic=True)
    with monkeypatch.context() as patch:
        patch.setattr(type(system.pipeline.keeper), "stop_autosave", unsaved)
        with pytest.raises(WorkerError, match="too late"), system:
            raise WorkerError("too late")
    assert "the disk is full" in caplog.text
    system.shutdown()


def test_failure_in_the_block_is_reported_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(_core, "process_new_keyframe", breaks)
    deterministic = new_system(Sensor.RGBD, deterministic=True)
    with pytest.raises(WorkerError, match="out of order"), deterministic as system:
        track(system, 0)
    assert caplog.text == ""
