# SPDX-License-Identifier: BSD-3-Clause
"""Poses found again that wait for the next frame; among fakes."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import Reason, TrackingState
from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.records import TrackingResult
from support.tracking_scene import Scene, lose

WANTED = 1000
"""Points of a reference keyframe of which so few are seen that a keyframe is wanted."""


# ---- confirmed by the next frame ---------------------------------------------------------------
def test_no_keyframe_until_the_next_frame_confirms_the_pose(scene: Scene) -> None:
    scene.run(40)
    lose(scene)
    scene.core.n_reference = WANTED
    found = scene.track()
    assert (found.state, found.estimate.unconfirmed) == (TrackingState.OK, True)
    assert not found.is_keyframe
    assert scene.core.n_inserted == 0
    confirmed = scene.track()
    assert not confirmed.estimate.unconfirmed
    assert confirmed.is_keyframe
    assert scene.tracking.n_relocalizations == 1


def test_once_confirmed_the_frame_found_is_a_keyframe_first(scene: Scene) -> None:
    """Where the map ends it sees more of it than those after it."""
    scene.run(40)
    lose(scene)
    scene.core.n_reference = WANTED
    scene.track()
    scene.track()
    found, confirming = scene.frames[-2:]
    assert scene.core.inserted == [found.id, confirming.id]
    scene.track()
    assert scene.core.inserted.count(found.id) == 1


def test_a_frame_found_where_the_map_needs_none_stays_a_frame(scene: Scene) -> None:
    scene.run(40)
    lose(scene)
    scene.run(1)
    scene.core.n_reference = WANTED
    scene.track()
    assert scene.core.inserted == [scene.last.id]


def not_confirmed(scene: Scene, how: str) -> TrackingResult:
    if how == "other points":
        return scene.track(map_points=np.arange(500, 600))
    if how == "few points in common":
        return scene.track(map_points=np.arange(86, 186))
    return lose(scene)


@pytest.mark.parametrize("how", ["other points", "few points in common", "lost at once"])
def test_what_is_not_confirmed_is_searched_on_from_the_old_place(scene: Scene, how: str) -> None:
    scene.run(40)
    before = scene.tracking.reference_keyframe
    lose(scene)
    scene.core.local_reference = 77  # where it seems to be
    scene.core.n_reference = WANTED
    found = scene.track()
    assert found.estimate.unconfirmed
    assert scene.tracking.reference_keyframe == 77
    outcome = not_confirmed(scene, how)
    assert outcome.state is TrackingState.LOST
    assert scene.core.n_inserted == 0
    if how != "lost at once":
        assert outcome.estimate.reason is Reason.NOT_CONFIRMED
    assert scene.last.T_cw is None
    assert scene.tracking.reference_keyframe == before
    assert scene.tracking.motion.last is scene.frames[39]


def test_the_next_frame_is_also_searched_where_the_one_found_was(scene: Scene) -> None:
    """At the border of the map a keyframe may show too little of it."""
    scene.run(40)
    lose(scene)
    scene.track()
    scene.core.calls.clear()
    scene.core.words.append(0)
    assert scene.track().state is TrackingState.OK
    assert scene.core.calls[:2] == ["words", "motion"]


def test_fifteen_points_in_common_confirm(scene: Scene) -> None:
    scene.run(40)
    lose(scene)
    scene.track()
    assert scene.track(map_points=np.arange(85, 185)).state is TrackingState.OK


# ---- features of a single camera -----------------------------------------------------------------
def test_more_features_in_localization_mode_and_in_turns_while_lost(scene: Scene) -> None:
    def factors() -> tuple[int, int]:
        tracking = scene.tracking
        return tracking.feature_factor(localize=False), tracking.feature_factor(localize=True)

    scene.run(40)
    assert factors() == (1, 2)
    while_lost = []
    for _ in range(4):
        assert lose(scene).state is TrackingState.LOST
        while_lost.append(factors())
    assert while_lost == [(2, 2), (1, 1), (2, 2), (1, 1)]
    assert [scene.track().state, scene.track().state] == [TrackingState.OK] * 2
    assert factors() == (1, 2)
    lose(scene)
    assert factors() == (2, 2), "counted from the last pose"


def test_more_features_after_a_pose_with_few_inliers(scene: Scene) -> None:
    """It is about to be lost."""
    scene.run(40)
    scarce = TrackingConfig().scarce_inliers
    for n_inliers, factor in ((scarce - 1, 2), (scarce, 1), (60, 2), (3 * scarce, 1)):
        scene.core.inliers.extend([n_inliers] * 2)
        assert scene.track().estimate.n_inliers == n_inliers
        assert scene.tracking.feature_factor(localize=False) == factor


def test_a_loaded_map_is_searched_with_the_usual_features_first(scene: Scene) -> None:
    scene.tracking.begin_in_loaded_map(None)
    assert scene.tracking.feature_factor(localize=True) == 1


def test_while_a_map_begins_the_initializer_decides(scene: Scene) -> None:
    scene.initializer.feature_factor = 4
    assert scene.tracking.feature_factor(localize=False) == 4
    assert scene.tracking.feature_factor(localize=True) == 4
    scene.run(40)
    assert scene.tracking.feature_factor(localize=False) == 1
