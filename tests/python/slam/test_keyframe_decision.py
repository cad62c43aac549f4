# SPDX-License-Identifier: BSD-3-Clause
"""When the tracker makes a keyframe, with the verbs of the core replaced."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import Sensor, TrackingState
from orbslam2py._core import Pose
from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.records import TrackingResult
from support.tracking_scene import (
    MAX_FRAMES,
    FakeCore,
    FakeFrame,
    Scene,
    lose,
    pose,
)


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
def test_keyframe_decision(sensor: Sensor, core: FakeCore, case: Case) -> None:
    # Too few inliers to go on tracking are enough for a decision.
    limits = TrackingConfig(local_map_inliers=1, map_matches=1)
    scene = Scene(sensor, core, limits)
    scene.run(1)
    scene.core.inliers.extend([100, 100])
    scene.core.n_reference = 10_000
    first = 2 * MAX_FRAMES
    assert scene.track(frame_id=first).is_keyframe  # the last one before the frame in question
    inserted = list(scene.mapping.inserted)

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
        assert scene.last.features.described


def test_the_map_is_extended_as_soon_as_the_camera_was_found(scene: Scene) -> None:
    """It may end there, and the camera may be on its way out of it."""
    scene.run(40)
    lose(scene)
    scene.map.n_keyframes = MAX_FRAMES + 1
    scene.core.n_reference = 1000
    n_before = scene.core.n_inserted
    assert not scene.track().is_keyframe, "not confirmed yet"
    assert scene.core.n_inserted == n_before
    assert scene.track().is_keyframe
    found, confirming = scene.frames[-2:]
    assert scene.core.inserted[n_before:] == [found.id, confirming.id]


def track_with(scene: Scene, n_inliers: int) -> TrackingResult:
    """Of the first estimate and in the local map."""
    scene.core.inliers.extend([n_inliers, n_inliers])
    return scene.track()


@pytest.mark.parametrize(("n_inliers", "keyframe"), [(194, True), (195, False)])
def test_a_keyframe_when_the_camera_leaves_what_the_last_one_saw(
    scene: Scene, n_inliers: int, keyframe: bool
) -> None:
    """300 inliers at most since then; the reference keyframe would ask for nothing."""
    scene.run(3)
    scene.core.n_reference = 100
    for seen in (200, 300, 250):
        assert not track_with(scene, seen).is_keyframe
    assert track_with(scene, n_inliers).is_keyframe == keyframe


@pytest.mark.parametrize(
    ("n_inliers", "moved", "keyframe"), [(149, 5.1, True), (150, 5.1, False), (149, 5.0, False)]
)
def test_a_keyframe_where_a_single_camera_hangs_on_few_points(
    single: Scene, monkeypatch: pytest.MonkeyPatch, n_inliers: int, moved: float, keyframe: bool
) -> None:
    """The reference keyframe has fewer; but from where the last one was there is nothing to see."""
    last = pose(3.0)
    monkeypatch.setattr(single.map, "keyframe_pose", {77: last}.__getitem__)
    compared = []

    def displacement(frame: FakeFrame, T_there: Pose) -> float:
        assert frame.T_cw is not None
        np.testing.assert_allclose(T_there.matrix[:3, :3], frame.T_cw.matrix[:3, :3])
        compared.append(T_there.center)
        return moved

    monkeypatch.setattr(single.core, "median_displacement", displacement)
    monkeypatch.setattr(single.core, "insert_keyframe", lambda *_, create_points: 77)
    single.core.n_reference = 1000
    assert track_with(single, 500).is_keyframe, "the last one"
    single.core.n_reference = 100
    assert track_with(single, n_inliers).is_keyframe == keyframe
    if n_inliers < 150:
        np.testing.assert_allclose(compared[-1], last.center)


@pytest.mark.parametrize("map_of_last", [-1, 5])
def test_a_map_that_has_none_of_the_last_keyframes_gets_one(
    single: Scene, monkeypatch: pytest.MonkeyPatch, map_of_last: int
) -> None:
    """The last one went with a map that was dropped, or is in another one: nothing is compared."""
    single.core.n_reference = 100
    monkeypatch.setattr(single.map, "map_of", lambda keyframe: map_of_last)
    monkeypatch.setattr(single.core, "insert_keyframe", lambda *_, create_points: 77)
    assert not track_with(single, 150).is_keyframe
    assert track_with(single, 149).is_keyframe


def test_what_was_seen_before_a_loss_does_not_count(scene: Scene) -> None:
    scene.run(3)
    scene.core.n_reference = 100
    assert not track_with(scene, 300).is_keyframe
    lose(scene)
    for _ in range(3):
        assert not track_with(scene, 120).is_keyframe


@pytest.mark.parametrize(
    ("staying", "untracked", "keyframe"),
    [(64, 71, True), (65, 71, False), (64, 70, False)],
)
def test_a_keyframe_before_the_camera_has_turned_away(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, staying: int, untracked: int, keyframe: bool
) -> None:
    """100 inliers, and as many points of the reference keyframe: nothing else asks for one."""
    original = scene.core.optimize_pose

    def moves(frame: FakeFrame) -> SimpleNamespace:
        frame.T_cw = pose(0.5 * frame.id)
        return original(frame)

    monkeypatch.setattr(scene.core, "optimize_pose", moves)
    scene.run(3)
    scene.core.n_reference = 100
    scene.core.n_staying = staying
    outcome = scene.track(close_counts=(200, untracked))
    assert outcome.is_keyframe == keyframe
    assert scene.core.looked_ahead == pytest.approx(1.5)


def test_without_a_speed_nobody_looks_ahead(scene: Scene) -> None:
    scene.run(40)
    scene.core.n_reference = 100
    scene.core.n_staying = 0
    assert not scene.track(frame_id=50, close_counts=(200, 500)).is_keyframe


def test_a_loaded_map_is_extended_as_soon_as_the_camera_was_found(scene: Scene) -> None:
    """It may end there."""
    scene.run(40)
    scene.tracking.begin_in_loaded_map(None)
    scene.map.n_keyframes = MAX_FRAMES + 1
    scene.core.n_reference = 1000
    assert not scene.track().is_keyframe, "not confirmed yet"
    assert scene.core.n_inserted == 0
    assert scene.track().is_keyframe
    found, confirming = scene.frames[-2:]
    assert scene.core.inserted == [found.id, confirming.id]
