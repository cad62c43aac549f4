# SPDX-License-Identifier: BSD-3-Clause
"""What the images say without the map ends a wrong map soon after it began, and no right one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py import (
    Callbacks,
    Reason,
    Sensor,
    System,
    TrackingLost,
    TrackingState,
    open_sequence,
)
from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.slam.initialization.initial_map_validation import InitialMapValidation
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.cut_sequences import corridor, cut, settings_of
from support.cut_sequences import track as track_all
from support.small_sequences import ate, black, new_system, play, track
from support.tracking_scene import Scene

pytestmark = pytest.mark.watchdog(120)

LIMITS = InitializationConfig()
_N_FRAMES = 70


class Walk:
    """The first images of a walk along a corridor, as frames, and where they were."""

    def __init__(self) -> None:
        sequence = SyntheticSequence(
            SyntheticOptions(
                world="corridor", sensor="mono", frames=120, size=(320, 240), noise=1.0
            )
        )
        front = FrontEnd(sequence.settings, Sensor.MONOCULAR)
        self.frames = [
            front.monocular(sequence.load(i).image, i, float(i), StageTimer())
            for i in range(_N_FRAMES)
        ]
        self.T_cw = [np.linalg.inv(T) for T in sequence.ground_truth().T_wc[:_N_FRAMES]]

    def tracked(self, degrees: float) -> list[core.TrackedFrame]:
        """The frames in a map whose ways all lead so many degrees beside the true ones."""
        turn = Rotation.from_euler("y", degrees, degrees=True)
        tracked = []
        for frame, T_cw in zip(self.frames, self.T_cw, strict=True):
            rotation = Rotation.from_matrix(T_cw[:3, :3])
            centre = -rotation.inv().apply(T_cw[:3, 3])
            one = core.TrackedFrame(frame)
            one.T_cw = core.Pose(rotation.as_quat(), -rotation.apply(turn.apply(centre)))
            tracked.append(one)
        return tracked


@pytest.fixture(scope="module")
def walk() -> Walk:
    return Walk()


def watch_of(frames: list[core.TrackedFrame], **limits: float) -> InitialMapValidation:
    watch = InitialMapValidation(InitializationConfig(**limits), seed=0)  # type: ignore[arg-type]
    watch.begin(frames[0])
    return watch


def shown(watch: InitialMapValidation, frames: Iterable[core.TrackedFrame]) -> tuple[int, bool]:
    """Frames shown until the watch ended, or all of them, and whether the map was contradicted."""
    n = 0
    for frame in frames:
        if not watch.watching:
            break
        n += 1
        if watch.contradicted(frame):
            return n, True
    return n, False


# ---- the comparison ------------------------------------------------------------------------------
def test_a_right_map_is_believed_soon(walk: Walk) -> None:
    frames = walk.tracked(0)
    watch = watch_of(frames)
    n, contradicted = shown(watch, frames[1:])
    assert not contradicted
    assert not watch.watching
    assert n < LIMITS.watched_frames


@pytest.mark.parametrize("degrees", [60, 90, -90, 180])
def test_a_wrong_map_is_contradicted(walk: Walk, degrees: float) -> None:
    frames = walk.tracked(degrees)
    watch = watch_of(frames)
    n, contradicted = shown(watch, frames[1:])
    assert contradicted
    assert not watch.watching
    assert LIMITS.contradictions <= n < LIMITS.watched_frames


def test_a_map_that_is_somewhat_bent_is_neither(walk: Walk) -> None:
    frames = walk.tracked(25)
    watch = watch_of(frames)
    assert shown(watch, frames[1:]) == (LIMITS.watched_frames, False)
    assert not watch.watching


def test_one_odd_frame_is_no_contradiction(walk: Walk) -> None:
    right, wrong = walk.tracked(0), walk.tracked(90)
    watch = watch_of(right, agreements=100)
    assert shown(watch, [*right[1:12], wrong[12], *right[13:]])[1] is False


def test_a_camera_that_rests_says_nothing(walk: Walk) -> None:
    frames = walk.tracked(90)
    resting = [frames[0]] * (LIMITS.watched_frames + 1)
    assert shown(watch_of(frames), resting[1:]) == (LIMITS.watched_frames, False)


def test_another_map_is_not_compared(walk: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = walk.tracked(90)
    watch = watch_of(frames)
    monkeypatch.setattr(watch, "_map_index", 1)
    assert not watch.contradicted(frames[1])
    assert not watch.watching


def test_where_every_map_is_contradicted_one_is_kept_in_the_end(walk: Walk) -> None:
    wrong, right = walk.tracked(90), walk.tracked(0)
    watch = watch_of(wrong)
    for _ in range(2):
        for _ in range(LIMITS.contradicted_maps):
            watch.begin(wrong[0])
            assert shown(watch, wrong[1:])[1]
        watch.begin(wrong[0])
        assert not watch.watching
    for _ in range(LIMITS.contradicted_maps):
        watch.begin(wrong[0])
        assert shown(watch, wrong[1:])[1]
    watch.reset()
    watch.begin(wrong[0])
    assert watch.watching
    # Until then one that is right begins the count anew.
    watch = watch_of(wrong)
    for _ in range(2):
        for frames in (wrong, wrong, right):
            watch.begin(frames[0])
            assert shown(watch, frames[1:])[1] == (frames is wrong)


# ---- in the system -------------------------------------------------------------------------------
def ways_apart(monkeypatch: pytest.MonkeyPatch, *degrees: float | None) -> None:
    """The watch finds the ways of map and images so far apart, one after the other."""
    left = iter(degrees)
    monkeypatch.setattr(InitialMapValidation, "_degrees_apart", lambda *_: next(left, 0.0))


def test_a_contradicted_map_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    ways_apart(monkeypatch, 90.0, None, 90.0, 90.0)
    losses: list[TrackingLost] = []
    callbacks = Callbacks(on_lost=losses.append)
    with new_system(Sensor.MONOCULAR, deterministic=True, callbacks=callbacks) as system:
        records = play(system, 40)
        reasons = [r.reason for r in records]
        at = reasons.index(Reason.MAP_CONTRADICTED)
        assert records[at].state is TrackingState.LOST
        assert records[at].T_cw is None
        assert all(r.state is TrackingState.OK for r in records[at - 4 : at])
        assert reasons.count(Reason.MAP_CONTRADICTED) == 1
        assert system.n_resets == 1
        assert [loss.reason for loss in losses] == [str(Reason.MAP_CONTRADICTED)]
        # The next map begins at once, with the images of the one before.
        assert records[at + 1].state is TrackingState.OK
        assert records[at + 1].map_index == 1
        path = system.trajectory()
        assert len(path) == 40
        assert not path.lost.any()
        assert ate(system) < 0.02


@pytest.mark.parametrize("lost", [False, True])
def test_it_is_not_given_up_once_it_is_used_for_localization(
    lost: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways_apart(monkeypatch, *[90.0] * 100)
    with new_system(Sensor.MONOCULAR, deterministic=True) as system:
        records = play(system, 1)
        while records[-1].state is not TrackingState.OK:
            records.append(track(system, len(records)))
        system.localization_mode = True
        begun = len(records)
        records.append(track(system, begun, shown=black(Sensor.MONOCULAR) if lost else None))
        assert (records[-1].state is TrackingState.LOST) == lost
        system.localization_mode = False
        records += play(system, 20, first=begun + 1)
        assert all(r.state is TrackingState.OK for r in records[begun + 1 :])
        assert system.n_resets == 0


def test_it_is_not_given_up_if_it_becomes_part_of_another_meanwhile(
    single: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def contradicts(frame: object) -> bool:
        single.map.active_map = 7
        monkeypatch.setattr(single.map, "map_of", lambda keyframe: 7)
        return True

    single.run(40)
    monkeypatch.setattr(single.map, "activate_map_of", lambda keyframe: 7, raising=False)
    monkeypatch.setattr(single.initializer, "contradicts", contradicts)
    outcome = single.track()
    assert outcome.state is TrackingState.OK
    assert outcome.given_up is None


def test_it_is_given_up_however_large_it_is(single: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    single.run(40)
    single.map.n_keyframes = 30
    monkeypatch.setattr(single.initializer, "contradicts", lambda frame: True)
    outcome = single.track()
    assert outcome.state is TrackingState.LOST
    assert outcome.estimate.reason is Reason.MAP_CONTRADICTED
    assert outcome.given_up == 0


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_depths_are_not_watched(sensor: Sensor, monkeypatch: pytest.MonkeyPatch) -> None:
    ways_apart(monkeypatch, *[90.0] * 100)
    with new_system(sensor, deterministic=True) as system:
        assert all(r.state is TrackingState.OK for r in play(system, 10))


@pytest.mark.shared
@pytest.mark.parametrize("seed", [0, 3])
def test_a_real_camera_that_takes_off_ends_with_a_right_map(seed: int, shared_data: Path) -> None:
    """A drone, seen with 2000 features: its first frames were 7 degrees off for ever."""
    sequence = open_sequence(shared_data / "sequences" / "drone_semicircle", "mono")
    truth = sequence.ground_truth()
    assert truth is not None
    settings = sequence.settings
    settings = replace(settings, orb=replace(settings.orb, n_features=2000))
    with System(settings, "mono", deterministic=True, seed=seed) as system:
        for i in range(len(sequence)):
            system.track_monocular(sequence.load(i).image, float(sequence.timestamps[i]))
        path = system.trajectory()
    figures = evaluate_trajectory(path.select(~path.lost), truth, Alignment.SIM3)
    assert figures.as_dict()["ate_rmse_m"] < 0.04


def test_one_that_began_beside_another_leaves_that_as_it_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def apart(watch: InitialMapValidation, frame: core.TrackedFrame) -> float:
        return 90.0 if frame.map_index == 1 else 0.0

    monkeypatch.setattr(InitialMapValidation, "_degrees_apart", apart)
    sequence = cut(corridor("mono"), range(50), 45, range(200, 270))
    with System(settings_of(sequence), "mono", deterministic=True) as system:
        records = track_all(system, sequence)
        assert [r.reason for r in records].count(Reason.MAP_CONTRADICTED) == 1
        first, given_up, last = system.trajectories()
        assert not first.lost[:50].any()
        # The frames that the wrong map held are in the next one as well.
        assert set(given_up.timestamps) <= set(last.timestamps)
        assert (~last.lost).sum() > 63
        assert [there.map_index for there in system.maps] == [0, 2]
        assert system.check_map() == []
