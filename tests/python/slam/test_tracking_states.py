# SPDX-License-Identifier: BSD-3-Clause
"""The tracker's states, with the verbs of the core replaced."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import Reason, Sensor, TrackingState
from support.tracking_scene import (
    MAX_FRAMES,
    OUTLIERS,
    FakeFrame,
    FakeMap,
    Scene,
    pose,
)


def test_before_the_first_image(scene: Scene) -> None:
    assert scene.tracking.state is TrackingState.NO_IMAGES_YET
    assert scene.tracking.reference_keyframe == -1


def test_waits_for_a_frame_that_can_begin_a_map(scene: Scene) -> None:
    scene.initializer.refusals = 2
    for _ in range(2):
        outcome = scene.track()
        assert outcome.state is scene.tracking.state is TrackingState.NOT_INITIALIZED
        assert outcome.estimate.reason is Reason.TOO_FEW_KEYPOINTS
        assert not outcome.is_keyframe
        assert outcome.given_up is None
    outcome = scene.track()
    assert outcome.state is scene.tracking.state is TrackingState.OK
    assert outcome.is_keyframe
    assert outcome.estimate.n_inliers == outcome.estimate.n_matches == 321
    assert scene.tracking.reference_keyframe == 0
    # The keypoints that became its points are off, and so is where it lies among them.
    np.testing.assert_array_equal(outcome.estimate.covariance, np.diag([1.0, 1, 1, 2, 2, 2]))


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
    """The original's tracker goes on with the culled one (OD-81)."""
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
    assert outcome.estimate.reason is reason
    assert (outcome.state is TrackingState.OK) == (reason is Reason.NONE)


@pytest.mark.parametrize(("inliers", "ok"), [(29, False), (30, True)])
@pytest.mark.parametrize("frame_id", [3, MAX_FRAMES])
def test_limits_of_the_local_map(scene: Scene, frame_id: int, inliers: int, ok: bool) -> None:
    expect_of_the_local_map(scene, frame_id, inliers, ok)


def expect_of_the_local_map(scene: Scene, frame_id: int, inliers: int, ok: bool) -> None:
    scene.run(frame_id)
    scene.core.n_reference = 0
    scene.core.inliers.extend([100, inliers])
    outcome = scene.track()
    assert outcome.estimate.n_inliers == inliers
    assert outcome.state is (TrackingState.OK if ok else TrackingState.LOST)
    assert outcome.estimate.reason is (Reason.NONE if ok else Reason.FEW_INLIERS_LOCAL_MAP)


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


def test_outliers_of_the_local_map(scene: Scene) -> None:
    scene.run(3)
    # Of the first estimate; of the local map; before the frame is remembered.
    assert scene.last.n_discards == 3
