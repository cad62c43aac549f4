# SPDX-License-Identifier: BSD-3-Clause
"""Localization mode: the map stays as it is, and the camera may leave it."""

from __future__ import annotations

import threading
from functools import lru_cache

import numpy as np
import pytest
from benchmarks.accuracy.mapped_world import MappedWorld

from orbslam2py import Sensor, System, TrackingRecord, TrackingState
from orbslam2py import _core as core
from orbslam2py._worker import PauseTicket
from orbslam2py.evaluation import pose_error
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.small_sequences import black, images, new_system, play, track
from support.worker_steps import eventually

pytestmark = pytest.mark.watchdog(60)


# ---- out of the map and back ---------------------------------------------------------------------
_STEP = 3.0  # degrees
_MAPPED = range(0, 12)  # steps of turning that are mapped
_FAR = 45  # where the camera turns back
_HOME = 6  # well inside of the map


class Turning(SyntheticSequence):
    """Frame i is turned to the right by i steps, in the middle of a room."""

    def T_wc(self, index: int) -> np.ndarray:
        angle = np.radians(_STEP * index)
        turned = np.eye(4)
        turned[[0, 2], [0, 2]] = np.cos(angle)
        turned[0, 2], turned[2, 0] = np.sin(angle), -np.sin(angle)
        turned[0, 3] = 0.02 * index
        return super().T_wc(0) @ turned


@lru_cache
def turning(sensor: Sensor) -> Turning:
    return Turning(SyntheticOptions(world="room", sensor=sensor, size=(320, 240), noise=1))


def turn(world: MappedWorld, steps: range) -> list[TrackingRecord]:
    return [world.show(world.sequence.load(i)) for i in steps]


def test_out_of_the_map_and_back(sensor: Sensor) -> None:
    world = MappedWorld(turning(sensor), _MAPPED)
    system = world.system
    assert world.n_tracked == len(_MAPPED)
    system.wait_until_idle()
    before = system.map_contents()
    system.localization_mode = True
    for _ in range(2):
        turn(world, range(_MAPPED[-1], _HOME, -1))
        out = turn(world, range(_HOME, _FAR))
        back = turn(world, range(_FAR - 1, _HOME - 1, -1))
        assert all(r.state is TrackingState.OK for r in [*out, *back])
        assert not out[0].visual_odometry
        assert out[-1].visual_odometry, "nothing of the map is in view"
        assert not back[-1].visual_odometry
        assert not any(r.is_keyframe for r in [*out, *back])
        assert all(r.n_inliers > 20 for r in [*out, *back])
        drift = world.error(out[-1], world.sequence.T_wc(_FAR - 1))
        assert drift.translation_m < 0.15
        assert drift.rotation_deg < 3
        home = world.error(back[-1], world.sequence.T_wc(_HOME))
        assert home.translation_m < 0.02
        assert home.rotation_deg < 0.5
        assert before.first_difference(system.map_contents()) is None
    assert system.check_map() == []
    assert len(system.trajectory()) == len(_MAPPED) + 4 * (_FAR - _HOME) + 10


def test_the_end_of_odometry_is_no_motion(sensor: Sensor) -> None:
    """Back in the map, the pose jumps by the drift; the motion model must not see it."""
    world = MappedWorld(turning(sensor), _MAPPED)
    world.system.localization_mode = True
    turn(world, range(_MAPPED[-1], _FAR))
    tracking, n_ends = world.system.pipeline.tracking, 0
    before: TrackingRecord | None = None
    for i in range(_FAR - 1, _MAPPED[-1] - 1, -1):
        [record] = turn(world, range(i, i + 1))
        if before is not None and before.visual_odometry and not record.visual_odometry:
            n_ends += 1
            assert tracking.motion.velocity is not None
            T_ab = np.linalg.inv(world.sequence.T_wc(i)) @ world.sequence.T_wc(i + 1)
            error = pose_error(tracking.motion.velocity.step.matrix, T_ab)
            # The jump is 8 cm and 1.8 degrees with a stereo pair.
            assert error.translation_m < 0.03
            assert error.rotation_deg < 0.5
        before = record
    assert n_ends >= 1


def test_switched_off_outside_the_map(sensor: Sensor) -> None:
    world = MappedWorld(turning(sensor), _MAPPED)
    before = world.system.map_hash()
    world.system.localization_mode = True
    assert turn(world, range(_MAPPED[-1], _FAR))[-1].visual_odometry
    world.system.localization_mode = False
    # A frame without a match in the map must not enter it.
    [record] = turn(world, range(_FAR, _FAR + 1))
    assert not record.visual_odometry
    if record.state is not TrackingState.OK:
        assert world.system.map_hash() == before
    assert world.system.check_map() == []


def test_a_small_map_is_kept(sensor: Sensor) -> None:
    """Lost with so few keyframes, mapping would start anew; here the map is the user's (OD-75)."""
    world = MappedWorld(turning(sensor), _MAPPED[:4])
    assert world.system.n_keyframes <= 5
    before = world.system.map_hash()
    world.system.localization_mode = True
    assert world.lose(3).state is TrackingState.LOST
    found = turn(world, range(3, -1, -1))
    assert [r.state for r in found] == [TrackingState.OK] * 4
    assert world.system.n_resets == 0
    assert world.system.map_hash() == before


def test_a_single_camera_is_lost_outside_the_map_and_found_inside() -> None:
    options = SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1)
    world = MappedWorld(SyntheticSequence(options), range(60))
    system, before = world.system, world.system.map_hash()
    system.localization_mode = True
    states = []
    for _ in range(2):
        away = [world.sequence.T_wc(59) @ _turned(3.0 * k) for k in range(40)]
        for number, T_wc in enumerate([*away, *reversed(away)]):
            record = world.show(world.sequence.view(T_wc, number))
            assert not record.visual_odometry
            states.append(record.state)
        assert states[-1] is TrackingState.OK
        assert world.error(record, T_wc).translation_m < 0.02
    assert TrackingState.LOST in states
    assert system.map_hash() == before


def test_a_single_camera_takes_more_features_in_localization_mode() -> None:
    options = SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1)
    world = MappedWorld(SyntheticSequence(options), range(30))
    shown = world.sequence.load(29)
    counts = []
    for seconds, mode in ((10.0, False), (10.1, True), (10.2, False)):
        world.system.localization_mode = mode
        record = world.system.track(shown, seconds, details=True)
        assert record.features is not None
        counts.append(len(record.features.keypoints))
    assert 1.5 * counts[0] < counts[1] <= 2.02 * counts[0]
    assert counts[2] == counts[0]


def _turned(degrees: float) -> np.ndarray:
    angle, turned = np.radians(degrees), np.eye(4)
    turned[[0, 2], [0, 2]] = np.cos(angle)
    turned[0, 2], turned[2, 0] = np.sin(angle), -np.sin(angle)
    return turned


# ---- switching -----------------------------------------------------------------------------------
@pytest.mark.parametrize("deterministic", [True, False])
def test_switching_at_any_time(sensor: Sensor, deterministic: bool) -> None:
    rng = np.random.default_rng(3)
    with new_system(sensor, deterministic=deterministic) as system:
        records: list[TrackingRecord] = []
        fixed: int | None = None
        n_fixed = 0
        for i in range(80):
            system.localization_mode = bool(rng.integers(4) == 0)
            if not system.localization_mode:
                fixed = None
            records.append(track(system, i))
            if system.pipeline.localization.on:
                assert not records[-1].is_keyframe
                assert fixed in (None, system.map_hash())
                fixed = system.map_hash()
                n_fixed += 1
        assert n_fixed > 10
        system.localization_mode = False
        records.append(track(system, 79, timestamp=100.0))
        assert system.wait_until_idle(20)
        assert [r.state for r in records] == [TrackingState.OK] * 81
        assert system.check_map() == []
        assert len(system.trajectory()) == 81


def test_last_assignment_counts(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 3)
        system.localization_mode = True
        system.localization_mode = False
        assert track(system, 3).state is TrackingState.OK
        assert not system.pipeline.back_end.mapping.worker.pausing
        system.localization_mode = True
        assert system.localization_mode
        track(system, 4)
        track(system, 5)
        assert system.pipeline.back_end.mapping.worker.pausing
        system.localization_mode = False
        track(system, 6)
        assert not system.pipeline.back_end.mapping.worker.pausing


@pytest.fixture
def slow_mapping(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Mapping stands in its refinement until the event is set."""
    go_on = threading.Event()
    refine = LocalMapping._refine

    def wait_and_refine(*arguments: object) -> None:
        go_on.wait(30)
        refine(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(LocalMapping, "_refine", wait_and_refine)
    return go_on


def test_waiting_keyframes_are_processed_afterwards(
    sensor: Sensor, slow_mapping: threading.Event
) -> None:
    """The original deletes them when the mode ends (OD-126)."""
    with new_system(sensor) as system:
        worker = system.pipeline.back_end.mapping.worker
        play(system, 1)
        assert worker.wait_until(lambda: worker._busy, 10)
        n = 1
        while worker.n_waiting == 0:
            track(system, n)
            n += 1
            assert n < 80
        n_waiting = worker.n_waiting

        def go_on_when_held() -> None:
            worker.wait_until(lambda: worker.held, 20)
            slow_mapping.set()

        system.localization_mode = True
        threading.Thread(target=go_on_when_held).start()  # the switch waits for the step
        fixed = play(system, 5, first=n)
        before = system.map_hash()
        assert worker.n_waiting == n_waiting
        assert not system.wait_until_idle(10), "they wait for the end of the mode"
        fixed += play(system, 5, first=n + 5)
        assert system.map_hash() == before
        assert not any(r.is_keyframe for r in fixed)
        system.localization_mode = False
        track(system, n + 10)
        assert system.wait_until_idle(20)
        assert worker.n_waiting == 0
        assert system.pipeline.back_end.loop_closing.last_keyframe >= n_waiting
        assert system.check_map() == []


def test_shutdown_in_localization_mode(sensor: Sensor) -> None:
    system = new_system(sensor)
    play(system, 20)
    system.localization_mode = True
    play(system, 2, first=20)
    system.shutdown(timeout=10)
    assert len(system.trajectory()) == 22


@pytest.mark.parametrize("deterministic", [True, False])
def test_reset_in_localization_mode(sensor: Sensor, deterministic: bool) -> None:
    """The original's reset waits for ever for the stopped mapper (OD-121)."""
    with new_system(sensor, deterministic=deterministic) as system:
        play(system, 20)
        system.localization_mode = True
        play(system, 2, first=20)
        system.reset()
        records = play(system, 1, first=22)
        eventually(lambda: system.n_keyframes > 0)  # before, the mode is not in force
        records += play(system, 4, first=23)
        assert system.localization_mode, "it is the user's choice"
        assert [r.map_index for r in records] == [1] * 5
        assert [r.state for r in records] == [TrackingState.OK] * 5
        assert system.pipeline.back_end.mapping.worker.pausing
        n_keyframes = system.n_keyframes
        assert n_keyframes >= 1
        play(system, 1, first=27)
        assert system.n_keyframes == n_keyframes
        system.localization_mode = False
        records = play(system, 40, first=28)
        assert system.wait_until_idle(20)
        assert [r.state for r in records] == [TrackingState.OK] * 40
        assert system.n_keyframes > 1
        assert system.check_map() == []


def test_before_the_first_image(sensor: Sensor) -> None:
    with new_system(sensor) as system:
        system.localization_mode = True
        assert track(system, 0, shown=black(sensor)).state is TrackingState.NOT_INITIALIZED
        assert track(system, 1).state is TrackingState.OK
        system.localization_mode = False
        assert track(system, 2).state is TrackingState.OK


def test_temporary_points_are_not_kept(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 10)
        system.localization_mode = True
        for i in range(10, 20):
            track(system, i)
            last = system.pipeline.tracking.motion.last
            assert (last.map_points < core.FIRST_TEMPORARY_POINT).all()
        record = track(system, 20, shown=images(sensor, 20), details=True)
        assert record.features is not None
        assert (record.features.map_point_ids < core.FIRST_TEMPORARY_POINT).all()


def test_system_has_the_mode_off() -> None:
    system = System("tum1", "mono")
    assert not system.localization_mode
    system.shutdown()


def test_an_interrupted_switch_holds_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mode is not in force: mapping goes on, and the next image may try again."""
    with new_system(Sensor.RGBD) as system:
        play(system, 10)
        switch = system.pipeline.localization
        workers = system.pipeline.back_end.map_workers

        def interrupted(*_: object) -> bool:
            raise KeyboardInterrupt

        monkeypatch.setattr(PauseTicket, "wait", interrupted)
        system.localization_mode = True
        with pytest.raises(KeyboardInterrupt):
            track(system, 10)
        monkeypatch.undo()
        assert not switch.on
        assert not any(worker.pausing for worker in workers)
        system.localization_mode = False
        play(system, 20, first=10)
        assert system.wait_until_idle(20)
        system.localization_mode = True
        track(system, 30)
        assert switch.on
        assert all(worker.pausing for worker in workers)
