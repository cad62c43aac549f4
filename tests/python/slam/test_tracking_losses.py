# SPDX-License-Identifier: BSD-3-Clause
"""The tracker lost and found, with the verbs of the core replaced."""

from __future__ import annotations

import pytest

from orbslam2py import Reason, TrackingState
from orbslam2py.slam.tracking import TrackingResult
from support.tracking_scene import MAX_FRAMES, FakeFrame, Scene, lose


def test_lost(scene: Scene) -> None:
    scene.run(3)
    outcome = lose(scene)
    assert outcome.state is scene.tracking.state is TrackingState.LOST
    assert outcome.estimate.reason is Reason.FEW_MATCHES_REFERENCE
    assert scene.last.T_cw is None, "a lost frame has no pose"
    assert scene.last.n_cleared > 0
    assert outcome.given_up is None
    assert not outcome.is_keyframe


def test_no_pose_when_the_local_map_fails(scene: Scene) -> None:
    """The original hands out the pose of the failed attempt (OD-73)."""
    scene.run(3)
    scene.core.inliers.extend([100, 0])
    assert scene.track().state is TrackingState.LOST
    assert scene.last.T_cw is None


@pytest.mark.parametrize(("n_keyframes", "reset"), [(1, True), (5, True), (6, False)])
def test_a_small_map_is_given_up(scene: Scene, n_keyframes: int, reset: bool) -> None:
    scene.run(3)
    scene.map.n_keyframes = n_keyframes
    assert (lose(scene).given_up is not None) == reset


def test_a_small_map_is_kept_in_the_dark_and_given_up_in_the_light(scene: Scene) -> None:
    scene.run(3)
    scene.map.n_keyframes = 3

    def look(n_keypoints: int) -> TrackingResult:
        scene.core.motion.extend([0, 0])
        scene.core.words.append(0)
        features = FakeFrame(len(scene.frames)).features
        features.size = n_keypoints
        return scene.track(features=features)

    for _ in range(4):
        outcome = look(n_keypoints=20)
        assert outcome.state is TrackingState.LOST
        assert outcome.given_up is None, "no map begins in the dark"
    assert look(n_keypoints=1000).given_up is not None


def test_a_small_map_that_shows_again_after_the_dark_goes_on(scene: Scene) -> None:
    scene.run(3)
    scene.map.n_keyframes = 3
    scene.core.motion.extend([0, 0])
    scene.core.words.append(0)
    features = FakeFrame(3).features
    features.size = 20
    assert scene.track(features=features).given_up is None
    scene.core.motion.clear()
    scene.core.words.clear()
    outcome = scene.track()
    assert outcome.state is TrackingState.OK
    assert outcome.given_up is None


def test_a_small_map_that_was_used_for_localization_is_kept(scene: Scene) -> None:
    """The original destroys it by a loss (OD-75)."""
    scene.run(3)
    scene.map.n_keyframes = 3
    scene.localize = True
    scene.core.motion.extend([0, 0])
    assert scene.track().given_up is None
    scene.localize = False
    assert lose(scene).given_up is None, "the map is the user's, also after the mode"


@pytest.mark.parametrize(("inliers", "found"), [(29, False), (30, True)])
def test_the_local_map_confirms_what_was_found(scene: Scene, inliers: int, found: bool) -> None:
    scene.run(40)
    lose(scene)
    scene.core.n_reference = 0
    # First estimate, local map by wide windows, and once more by narrow ones.
    scene.core.inliers.extend([100, 60, inliers])
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
    # The next frame: no motion model, wide search.
    scene.core.calls.clear()
    scene.core.inliers.extend([100, 60, 50])
    assert scene.track().state is TrackingState.OK
    assert scene.core.calls[0] == "words"
    wide, narrow = scene.core.radius_factors[-2:]
    assert wide == 5.0
    assert narrow < wide


def test_velocity_does_not_survive_a_loss(scene: Scene) -> None:
    """The original's does (OD-74)."""
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
    """The original takes it there, too (OD-74)."""
    scene.run(3)
    scene.core.n_reference = 0
    scene.track(frame_id=10)  # frames in between were refused
    scene.core.calls.clear()
    scene.track(frame_id=11)
    assert "motion" not in scene.core.calls
    scene.track(frame_id=12)
    assert "motion" in scene.core.calls


def test_reset_forgets_all_but_the_counts(scene: Scene) -> None:
    """The original keeps the velocity and the id of the last relocalization (OD-70)."""
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
