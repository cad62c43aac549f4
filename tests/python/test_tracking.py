# SPDX-License-Identifier: BSD-3-Clause
"""The tracker's state machine and keyframe decision, with the verbs of the core replaced."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import _core
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam import initialization, keyframe_decision, tracking
from orbslam2py.slam.records import Reason, TrackingState
from orbslam2py._timing import StageTimer
from orbslam2py.slam.tracking import Tracking, TrackingOutcome

MAX_FRAMES = 30
OUTLIERS = np.array([7, 9])


def pose(x: float) -> _core.Pose:
    return _core.Pose([0, 0, 0, 1], [x, 0, 0])


class FakeFrame:
    """Counts what is done to it."""

    def __init__(self, frame_id: int) -> None:
        self.id = frame_id
        self.timestamp = frame_id / 30
        self.frame = SimpleNamespace(size=1000, depth=np.ones(1000, np.float32), described=False)
        self.T_cw: _core.Pose | None = None
        self.reference_keyframe = -1
        self.map_points = np.arange(100)
        self.close_counts = (200, 0)
        self.n_cleared = 0
        self.n_discards = 0
        self.anchor_x = 0.0
        self.big_change = 0

    def share_anchor(self, other: FakeFrame) -> None:
        self.anchor_x, self.big_change = other.anchor_x, other.big_change
        self.reference_keyframe = other.reference_keyframe

    def clear_associations(self) -> None:
        self.n_cleared += 1

    def discard_outliers(self) -> np.ndarray:
        self.n_discards += 1
        return OUTLIERS

    def n_associated(self) -> int:
        return 321

    def n_close_tracked_untracked(self) -> tuple[int, int]:
        return self.close_counts


class FakeMap:
    def __init__(self) -> None:
        self.n_keyframes = 10
        self.n_points = 1000
        self.keyframe_x = 0.0
        self.stretched = 1.0
        self.big_change_index = 0
        self.culled: dict[int, int] = {}

    def living(self, keyframe: int) -> int:
        return self.culled.get(keyframe, keyframe)


class FakeWorker:
    def __init__(self) -> None:
        self.pausing = False
        self.idle = True
        self.n_waiting = 0
        self.n_interrupts = 0

    def interrupt(self) -> None:
        self.n_interrupts += 1


class FakeMapping:
    def __init__(self) -> None:
        self.worker = FakeWorker()
        self.inserted: list[int] = []

    def insert_keyframe(self, keyframe: int) -> None:
        self.inserted.append(keyframe)


@dataclass
class FakeCore:
    """The verbs tracking calls; each takes its next answer from a list, or its usual one."""

    Pose = _core.Pose
    motion: deque[int] = field(default_factory=deque)
    words: deque[int] = field(default_factory=deque)
    inliers: deque[int] = field(default_factory=deque)
    n_reference: int = 100
    local_reference: int = 4
    calls: list[str] = field(default_factory=list)
    windows: list[float] = field(default_factory=list)
    forward: list[bool] = field(default_factory=list)
    reference_keyframes: list[int] = field(default_factory=list)
    radius_factors: list[float] = field(default_factory=list)
    discarded: list[np.ndarray] = field(default_factory=list)
    min_observations: list[int] = field(default_factory=list)
    start_poses: list[float] = field(default_factory=list)
    n_inserted: int = 0

    def PointBatch(self) -> str:
        return "no points"

    def follow_map(self, world: FakeMap, frame: FakeFrame) -> tuple[str, float]:
        assert frame.T_cw is not None
        frame.T_cw = frame.T_cw @ pose(world.keyframe_x - frame.anchor_x)
        frame.anchor_x = world.keyframe_x
        frame.big_change = world.big_change_index
        return "points", world.stretched

    def anchor_frame(self, world: FakeMap, frame: FakeFrame, keyframe: int) -> None:
        frame.anchor_x = world.keyframe_x
        frame.reference_keyframe = keyframe

    def add_temporary_points(self, last: FakeFrame, points: str) -> int:
        return 0

    def match_last_frame(
        self, frame: FakeFrame, last: FakeFrame, points: str, window: float, has_depth: bool
    ) -> int:
        assert points == "points"
        assert frame.T_cw is not None
        self.calls.append("motion")
        self.windows.append(window)
        self.start_poses.append(float(frame.T_cw.matrix[0, 3]))
        return self.motion.popleft() if self.motion else 50

    def match_keyframe_by_words(
        self, world: FakeMap, keyframe: int, frame: FakeFrame, ratio: float
    ) -> int:
        assert frame.frame.described
        assert ratio == 0.7
        assert frame.T_cw is not None
        self.calls.append("words")
        self.reference_keyframes.append(keyframe)
        self.start_poses.append(float(frame.T_cw.matrix[0, 3]))
        return self.words.popleft() if self.words else 50

    def describe(self, frame: Any, vocabulary: str) -> None:
        assert vocabulary == "vocabulary"
        frame.described = True

    def optimize_pose(self, frame: FakeFrame) -> SimpleNamespace:
        self.calls.append("optimize")
        n = self.inliers.popleft() if self.inliers else 100
        return SimpleNamespace(n_inliers=n, covariance=np.eye(6) * n)

    def select_local_map(self, world: FakeMap, frame: FakeFrame) -> SimpleNamespace:
        self.calls.append("local map")
        if self.local_reference >= 0:
            frame.reference_keyframe = self.local_reference
            frame.big_change = world.big_change_index
        return SimpleNamespace(reference_keyframe=self.local_reference, points="local points")

    def match_local_map(
        self, frame: FakeFrame, points: str, discarded: np.ndarray, factor: float
    ) -> SimpleNamespace:
        assert points == "local points"
        self.radius_factors.append(factor)
        self.discarded.append(discarded)
        return SimpleNamespace(visible=np.arange(3))

    def count_sightings(self, world: FakeMap, frame: FakeFrame, visible: np.ndarray) -> None:
        assert len(visible) == 3
        self.calls.append("sightings")

    def count_tracked_points(self, world: FakeMap, keyframe: int, min_observations: int) -> int:
        self.min_observations.append(min_observations)
        return self.n_reference

    def insert_keyframe(self, world: FakeMap, frame: FakeFrame, create_points: bool) -> int:
        assert frame.frame.described
        assert create_points
        self.n_inserted += 1
        frame.reference_keyframe = 100 + self.n_inserted
        return 100 + self.n_inserted


class FakeInitializer:
    """Refuses a given number of frames."""

    def __init__(self, refusals: int = 0) -> None:
        self.refusals = refusals

    def reset(self) -> None:
        self.refusals = 0

    def try_initialize(self, frame: FakeFrame) -> Reason:
        if self.refusals:
            self.refusals -= 1
            return Reason.TOO_FEW_KEYPOINTS
        frame.T_cw = pose(0)
        frame.reference_keyframe = 0
        return Reason.NONE


class Scene:
    """A tracker among fakes."""

    def __init__(self, sensor: Sensor, core: FakeCore) -> None:
        self.core = core
        self.map = FakeMap()
        self.mapping = FakeMapping()
        self.tracking = Tracking(
            self.map,  # type: ignore[arg-type]
            "vocabulary",  # type: ignore[arg-type]
            self.mapping,  # type: ignore[arg-type]
            sensor,
            MAX_FRAMES,
        )
        self.initializer = FakeInitializer()
        self.tracking._initializer = self.initializer  # type: ignore[assignment]
        self.frames: list[FakeFrame] = []

    def track(self, frame_id: int | None = None, **attributes: Any) -> TrackingOutcome:
        frame = FakeFrame(len(self.frames) if frame_id is None else frame_id)
        for name, value in attributes.items():
            setattr(frame, name, value)
        self.frames.append(frame)
        return self.tracking.track(frame, StageTimer())  # type: ignore[arg-type]

    def run(self, n: int) -> None:
        """So many frames that make no keyframe."""
        self.core.n_reference, before = 0, self.core.n_reference
        for _ in range(n):
            assert self.track().state is TrackingState.OK
        self.core.n_reference = before

    @property
    def last(self) -> FakeFrame:
        return self.frames[-1]


@pytest.fixture
def core(monkeypatch: pytest.MonkeyPatch) -> FakeCore:
    core = FakeCore()
    monkeypatch.setattr(tracking, "core", core)
    monkeypatch.setattr(keyframe_decision, "core", core)
    return core


@pytest.fixture(params=[Sensor.STEREO, Sensor.RGBD])
def sensor(request: pytest.FixtureRequest) -> Sensor:
    return Sensor(request.param)


@pytest.fixture
def scene(core: FakeCore, sensor: Sensor) -> Scene:
    return Scene(sensor, core)


# ---- states --------------------------------------------------------------------------------------
def test_before_the_first_image(scene: Scene) -> None:
    assert scene.tracking.state is TrackingState.NO_IMAGES_YET
    assert scene.tracking.reference_keyframe == -1


def test_waits_for_a_frame_that_can_begin_a_map(scene: Scene) -> None:
    scene.initializer.refusals = 2
    for _ in range(2):
        outcome = scene.track()
        assert outcome.state is scene.tracking.state is TrackingState.NOT_INITIALIZED
        assert outcome.reason is Reason.TOO_FEW_KEYPOINTS
        assert not outcome.is_keyframe
        assert not outcome.reset_needed
    outcome = scene.track()
    assert outcome.state is scene.tracking.state is TrackingState.OK
    assert outcome.is_keyframe
    assert outcome.n_inliers == outcome.n_matches == 321
    assert scene.tracking.reference_keyframe == 0
    np.testing.assert_array_equal(outcome.covariance, np.zeros((6, 6)))


def test_second_frame_has_no_velocity(scene: Scene) -> None:
    scene.run(2)
    assert "motion" not in scene.core.calls
    assert scene.core.calls[0] == "words"


def test_motion_model_from_the_third_frame(scene: Scene) -> None:
    scene.run(2)
    scene.core.calls.clear()
    scene.run(1)
    expected = ["motion", "optimize", "local map", "optimize", "sightings"]
    assert scene.core.calls == expected
    np.testing.assert_array_equal(scene.core.discarded[-1], OUTLIERS)


def test_velocity_moves_the_start(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.run(2)
    original = scene.core.optimize_pose

    def moves(frame: FakeFrame) -> SimpleNamespace:
        frame.T_cw = pose(0.5 * frame.id)
        return original(frame)

    monkeypatch.setattr(scene.core, "optimize_pose", moves)
    scene.run(2)
    # Frame 2 starts from velocity 0; it moves by 1, so frame 3 starts 1 further on.
    assert scene.core.start_poses[-2:] == [0.0, 2.0]


def test_last_frame_follows_its_reference_keyframe(scene: Scene) -> None:
    scene.run(3)
    scene.map.keyframe_x += 5.0  # mapping has moved everything
    scene.run(1)
    assert scene.core.start_poses[-1] == pytest.approx(5.0)


def test_speed_follows_a_change_of_scale(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.run(2)
    original = scene.core.optimize_pose

    def moves(frame: FakeFrame) -> SimpleNamespace:
        frame.T_cw = pose(0.5 * frame.id)
        return original(frame)

    monkeypatch.setattr(scene.core, "optimize_pose", moves)
    scene.run(1)
    scene.map.stretched = 1.5  # the drift of scale that a loop took out
    scene.run(1)
    assert scene.core.start_poses[-1] == pytest.approx(1.0 + 1.5 * 1.0)


def test_no_speed_between_two_states_of_the_map(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.run(3)
    original = scene.core.match_last_frame

    def moves(*arguments: Any) -> int:
        scene.map.big_change_index = 1  # a loop is closed after the frame has begun
        return original(*arguments)

    monkeypatch.setattr(scene.core, "match_last_frame", moves)
    scene.run(1)
    scene.core.calls.clear()
    scene.run(1)
    assert "motion" not in scene.core.calls


def test_tries_again_when_the_map_moved_while_a_frame_was_tracked(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.run(3)
    scene.core.calls.clear()
    scene.core.inliers.extend([100, 1])  # the local map does not fit
    original = scene.core.select_local_map

    def moves(world: FakeMap, frame: FakeFrame) -> SimpleNamespace:
        world.big_change_index = 1
        return original(world, frame)

    monkeypatch.setattr(scene.core, "select_local_map", moves)
    assert scene.track().state is TrackingState.OK
    assert scene.core.calls.count("local map") == 2
    scene.core.inliers.extend([100, 1])
    assert scene.track().state is TrackingState.LOST, "only once"


def test_a_culled_reference_keyframe_gives_way_to_its_parent(scene: Scene) -> None:
    scene.run(2)
    scene.map.culled[4] = 2
    scene.core.local_reference = -1
    scene.core.motion.extend([0, 0])
    scene.run(1)
    assert scene.core.reference_keyframes[-1] == 2


def test_search_window(scene: Scene, sensor: Sensor) -> None:
    scene.run(3)
    radius = 7.0 if sensor is Sensor.STEREO else 15.0
    assert scene.core.windows == [radius]
    scene.core.motion.extend([19, 20])
    scene.run(1)
    assert scene.core.windows[1:] == [radius, 2 * radius]
    assert scene.core.calls.count("words") == 1, "20 matches in the wide window are enough"
    scene.core.motion.extend([20])
    scene.run(1)
    assert scene.core.windows[3:] == [radius]


@pytest.mark.parametrize(
    ("motion", "inliers", "by_words"),
    [
        ([19, 19], [], True),
        ([19, 20], [10], False),
        ([20], [9], True),
        ([20], [10], False),
    ],
)
def test_falls_back_to_the_reference_keyframe(
    scene: Scene, motion: list[int], inliers: list[int], by_words: bool
) -> None:
    scene.run(3)
    scene.core.calls.clear()
    scene.core.motion.extend(motion)
    scene.core.inliers.extend(inliers)
    assert scene.track().state is TrackingState.OK
    assert ("words" in scene.core.calls) == by_words
    if by_words:
        assert scene.core.reference_keyframes[-1] == 4


@pytest.mark.parametrize(
    ("words", "inliers", "reason"),
    [
        (14, [], Reason.FEW_MATCHES_REFERENCE),
        (15, [10], Reason.NONE),
        (15, [9], Reason.FEW_INLIERS_REFERENCE),
    ],
)
def test_limits_of_the_reference_keyframe(
    scene: Scene, words: int, inliers: list[int], reason: Reason
) -> None:
    scene.run(3)
    scene.core.motion.extend([0, 0])
    scene.core.words.append(words)
    scene.core.inliers.extend(inliers)
    outcome = scene.track()
    assert outcome.reason is reason
    assert (outcome.state is TrackingState.OK) == (reason is Reason.NONE)


@pytest.mark.parametrize(
    ("frame_id", "inliers", "ok"),
    [
        (MAX_FRAMES - 1, 49, False),  # a young map has to prove itself
        (MAX_FRAMES - 1, 50, True),
        (MAX_FRAMES, 29, False),
        (MAX_FRAMES, 30, True),
    ],
)
def test_limits_of_the_local_map(scene: Scene, frame_id: int, inliers: int, ok: bool) -> None:
    scene.run(frame_id)
    scene.core.inliers.extend([100, inliers])
    outcome = scene.track()
    assert outcome.n_inliers == inliers
    assert outcome.state is (TrackingState.OK if ok else TrackingState.LOST)
    assert outcome.reason is (Reason.NONE if ok else Reason.FEW_INLIERS_LOCAL_MAP)


def test_search_radius_in_the_local_map(scene: Scene, sensor: Sensor) -> None:
    scene.run(4)
    usual = 3.0 if sensor is Sensor.RGBD else 1.0
    assert scene.core.radius_factors == [5.0, usual, usual]


def test_reference_keyframe_follows_the_votes(scene: Scene) -> None:
    scene.run(2)
    assert scene.tracking.reference_keyframe == scene.last.reference_keyframe == 4
    scene.core.local_reference = -1  # no votes
    scene.run(1)
    assert scene.tracking.reference_keyframe == scene.last.reference_keyframe == 4


def test_outliers_of_the_local_map(scene: Scene, sensor: Sensor) -> None:
    scene.run(3)
    # Of the first estimate; of the local map (stereo); before the frame is remembered.
    assert scene.last.n_discards == (3 if sensor is Sensor.STEREO else 2)


# ---- lost and found ------------------------------------------------------------------------------
def lose(scene: Scene) -> TrackingOutcome:
    scene.core.motion.extend([0, 0])
    scene.core.words.append(0)
    return scene.track()


def test_lost(scene: Scene) -> None:
    scene.run(3)
    outcome = lose(scene)
    assert outcome.state is scene.tracking.state is TrackingState.LOST
    assert outcome.reason is Reason.FEW_MATCHES_REFERENCE
    assert scene.last.T_cw is None, "a lost frame has no pose"
    assert scene.last.n_cleared > 0
    assert not outcome.reset_needed
    assert not outcome.is_keyframe


def test_no_pose_when_the_local_map_fails(scene: Scene) -> None:
    scene.run(3)
    scene.core.inliers.extend([100, 0])
    assert scene.track().state is TrackingState.LOST
    assert scene.last.T_cw is None


@pytest.mark.parametrize(("n_keyframes", "reset"), [(1, True), (5, True), (6, False)])
def test_a_small_map_is_given_up(scene: Scene, n_keyframes: int, reset: bool) -> None:
    scene.run(3)
    scene.map.n_keyframes = n_keyframes
    assert lose(scene).reset_needed == reset


def test_a_small_map_that_was_used_for_localization_is_kept(scene: Scene) -> None:
    scene.run(3)
    scene.map.n_keyframes = 3
    scene.tracking.localization_only = True
    scene.core.motion.extend([0, 0])
    assert not scene.track().reset_needed
    scene.tracking.localization_only = False
    assert not lose(scene).reset_needed, "the map is the user's, also after the mode"


@pytest.mark.parametrize(("inliers", "found"), [(49, False), (50, True)])
def test_a_frame_found_again_has_to_prove_itself(scene: Scene, inliers: int, found: bool) -> None:
    scene.run(40)
    lose(scene)
    scene.core.n_reference = 0
    scene.core.inliers.extend([100, inliers])
    assert (scene.track().state is TrackingState.OK) == found
    assert scene.tracking.n_relocalizations == int(found)


def test_lost_keeps_trying_the_reference_keyframe_and_recovers(scene: Scene) -> None:
    scene.run(40)
    lose(scene)
    for _ in range(3):
        scene.core.calls.clear()
        scene.core.words.append(14)
        assert scene.track().state is TrackingState.LOST
        assert scene.core.calls == ["words"], "no motion model while lost"
        assert scene.core.reference_keyframes[-1] == 4
    assert scene.tracking.n_relocalizations == 0

    scene.core.n_reference = 0
    assert scene.track().state is TrackingState.OK
    assert scene.tracking.n_relocalizations == 1
    recovered = scene.last.id
    # The next frame: no motion model, wide search, 50 inliers needed for one second.
    scene.core.calls.clear()
    scene.core.inliers.extend([100, 50])
    assert scene.track().state is TrackingState.OK
    assert scene.core.calls[0] == "words"
    assert scene.core.radius_factors[-1] == 5.0
    scene.run(recovered + MAX_FRAMES - 1 - len(scene.frames))
    assert scene.frames[-1].id == recovered + MAX_FRAMES - 2
    scene.core.inliers.extend([100, 49])
    assert scene.track().state is TrackingState.LOST


def test_velocity_does_not_survive_a_loss(scene: Scene) -> None:
    scene.run(40)
    lose(scene)
    scene.run(2)
    scene.core.calls.clear()
    # Velocity between the two frames after the recovery.
    scene.run(1)
    assert "motion" in scene.core.calls
    lose(scene)
    scene.core.calls.clear()
    scene.run(1)
    assert "motion" not in scene.core.calls


def test_no_velocity_across_a_gap(scene: Scene) -> None:
    scene.run(3)
    scene.core.n_reference = 0
    scene.track(frame_id=10)  # frames in between were refused
    scene.core.calls.clear()
    scene.track(frame_id=11)
    assert "motion" not in scene.core.calls
    scene.track(frame_id=12)
    assert "motion" in scene.core.calls


def test_reset_forgets_all_but_the_counts(scene: Scene) -> None:
    scene.run(40)
    lose(scene)
    scene.run(1)
    scene.tracking.reset()
    assert scene.tracking.state is TrackingState.NO_IMAGES_YET
    assert scene.tracking.reference_keyframe == -1
    assert scene.tracking.n_relocalizations == 1, "they happened, whatever became of the map"
    scene.frames.clear()
    scene.core.calls.clear()
    scene.run(2)
    assert "motion" not in scene.core.calls
    scene.run(MAX_FRAMES - 2)
    scene.core.inliers.extend([100, 30])
    assert scene.track().state is TrackingState.OK, "the old recovery no longer counts"


# ---- is a keyframe needed? -----------------------------------------------------------------------
@dataclass(frozen=True)
class Case:
    """One row of the table; the defaults alone give a keyframe."""

    keyframe: bool
    why: str
    idle: bool = True
    n_waiting: int = 0
    n_inliers: int = 100
    n_reference: int = 200
    close: tuple[int, int] = (200, 0)
    frames_since: int = 5
    n_keyframes: int = 10
    pausing: bool = False
    interrupts: int = 0


TABLE = [
    Case(True, "mapper idle, half of the reference's points"),
    Case(True, "just below 0.75", n_inliers=149),
    Case(False, "0.75 is not below 0.75", n_inliers=150),
    Case(False, "nothing new", n_inliers=200),
    Case(True, "few close points, many that could be added", n_inliers=200, close=(99, 71)),
    Case(False, "enough close points", n_inliers=200, close=(100, 71)),
    Case(False, "too few to add", n_inliers=200, close=(99, 70)),
    Case(False, "15 inliers are too few", n_inliers=15, frames_since=5),
    Case(True, "16 inliers", n_inliers=16),
    Case(True, "one keyframe: below 0.4", n_keyframes=1, n_inliers=79),
    Case(False, "one keyframe: 0.4", n_keyframes=1, n_inliers=80),
    Case(True, "two keyframes: 0.75", n_keyframes=2, n_inliers=149),
    Case(False, "paused", pausing=True),
    Case(False, "busy, neither a second passed nor weak", idle=False),
    Case(True, "busy, but below 0.25", idle=False, n_inliers=49, interrupts=1),
    Case(False, "busy, 0.25 is not below 0.25", idle=False, n_inliers=50),
    Case(True, "busy, needs close points", idle=False, close=(99, 71), interrupts=1),
    Case(True, "busy, a second passed", idle=False, frames_since=MAX_FRAMES, interrupts=1),
    Case(False, "busy, nearly a second", idle=False, frames_since=MAX_FRAMES - 1),
    Case(False, "busy, a second passed, nothing new", idle=False, frames_since=99, n_inliers=150),
    Case(True, "2 wait", idle=False, n_waiting=2, frames_since=MAX_FRAMES, interrupts=1),
    Case(False, "3 wait", idle=False, n_waiting=3, frames_since=MAX_FRAMES, interrupts=1),
    Case(False, "3 wait, weak", idle=False, n_waiting=3, n_inliers=20, interrupts=1),
]


@pytest.mark.parametrize("case", TABLE, ids=lambda case: case.why)
def test_keyframe_decision(scene: Scene, case: Case) -> None:
    scene.run(1)
    scene.core.inliers.extend([100, 100])
    scene.core.n_reference = 10_000
    first = 2 * MAX_FRAMES
    assert scene.track(frame_id=first).is_keyframe  # the last one before the frame in question
    inserted = list(scene.mapping.inserted)

    # Too few inliers to go on tracking are enough for a decision.
    limits = tracking.TrackingThresholds(local_map_inliers=1, map_matches=1)
    scene.tracking._limits = scene.tracking._keyframe_decision.limits = limits
    scene.map.n_keyframes = case.n_keyframes
    scene.core.n_reference = case.n_reference
    worker = scene.mapping.worker
    worker.idle, worker.n_waiting, worker.pausing = case.idle, case.n_waiting, case.pausing
    scene.core.inliers.extend([100, case.n_inliers])
    frame_id = first + case.frames_since
    outcome = scene.track(frame_id=frame_id, close_counts=case.close)
    assert outcome.state is TrackingState.OK
    assert outcome.is_keyframe == case.keyframe
    assert worker.n_interrupts == case.interrupts
    assert len(scene.mapping.inserted) - len(inserted) == int(case.keyframe)
    if not case.pausing:
        assert scene.core.min_observations[-1] == (2 if case.n_keyframes <= 2 else 3)
    if case.keyframe:
        keyframe = scene.mapping.inserted[-1]
        assert scene.tracking.reference_keyframe == scene.last.reference_keyframe == keyframe
        assert scene.last.frame.described


@pytest.mark.parametrize(
    ("since", "n_keyframes", "keyframe"),
    [
        (MAX_FRAMES - 1, MAX_FRAMES + 1, False),
        (MAX_FRAMES - 1, MAX_FRAMES, True),
        (MAX_FRAMES, MAX_FRAMES + 1, True),
    ],
)
def test_no_keyframe_soon_after_a_recovery_in_a_large_map(
    scene: Scene, since: int, n_keyframes: int, keyframe: bool
) -> None:
    scene.run(40)
    lose(scene)
    scene.run(1)
    recovered = scene.last.id
    scene.map.n_keyframes = n_keyframes
    scene.core.n_reference = 1000
    assert scene.track(frame_id=recovered + since).is_keyframe == keyframe


# ---- how a map begins ----------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("size", "n_depths", "reason"),
    [
        (500, 500, Reason.TOO_FEW_KEYPOINTS),
        (501, 99, Reason.TOO_FEW_DEPTHS),
        (501, 100, Reason.NONE),
    ],
)
def test_depth_initializer(
    monkeypatch: pytest.MonkeyPatch, size: int, n_depths: int, reason: Reason
) -> None:
    inserted: list[dict[str, Any]] = []

    def insert(_map: FakeMap, frame: FakeFrame, **options: Any) -> int:
        assert frame.frame.described
        frame.reference_keyframe = 0
        inserted.append(options)
        return 0

    fake = SimpleNamespace(Pose=_core.Pose, describe=FakeCore().describe, insert_keyframe=insert)
    monkeypatch.setattr(initialization, "core", fake)
    mapping = FakeMapping()
    frame = FakeFrame(0)
    depth = np.full(size, -1, np.float32)
    depth[:n_depths] = 2.0
    frame.frame = SimpleNamespace(size=size, depth=depth, described=False)
    initializer = initialization.DepthInitializer(
        FakeMap(),  # type: ignore[arg-type]
        "vocabulary",  # type: ignore[arg-type]
        mapping,  # type: ignore[arg-type]
    )
    assert initializer.try_initialize(frame) is reason  # type: ignore[arg-type]
    if reason is Reason.NONE:
        assert mapping.inserted == [0]
        assert frame.T_cw is not None
        np.testing.assert_array_equal(frame.T_cw.matrix, np.eye(4))
        assert frame.reference_keyframe == 0
        assert inserted[0]["create_points"]
        assert inserted[0]["n_minimum"] >= size, "a point for every depth"
    else:
        assert mapping.inserted == []
        assert frame.T_cw is None
