# SPDX-License-Identifier: BSD-3-Clause
"""Visual odometry has to prove itself like a pose in the map; among fakes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from orbslam2py import Reason, Sensor, TrackingState, _core
from orbslam2py.slam.config import AcceptanceConfig, TrackingConfig
from orbslam2py.slam.records import PoseMethod, TrackingResult, Verdict
from orbslam2py.slam.state import State
from support.tracking_scene import FakeCore, FakeFrame, Scene, every_way_ends_elsewhere

USUAL = 100
NOT_OF_THE_MAP = _core.FIRST_TEMPORARY_POINT + np.arange(100)
#: Frames until the first second after the start, with its own limit of inliers, is over.
_SETTLED = 40


@pytest.fixture
def scene(core: FakeCore) -> Scene:
    """In localization mode, used to 100 inliers; other ways than the first end elsewhere."""
    scene = Scene(
        Sensor.STEREO,
        core,
        TrackingConfig(local_map_inliers=10),
        evidence=AcceptanceConfig(),
    )
    scene.localize = True
    scene.run(_SETTLED)
    core.n_staying = 200
    core.calls.clear()
    return scene


@pytest.fixture
def apart(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> Callable[..., TrackingResult]:
    """Track a frame whose pose every way finds somewhere else, with so many inliers in turn."""
    elsewhere = every_way_ends_elsewhere(scene.core)

    def track(*inliers: int) -> TrackingResult:
        scene.core.inliers.extend(inliers)
        with monkeypatch.context() as patched:
            patched.setattr(scene.core, "optimize_pose", elsewhere)
            outcome = scene.track()
        scene.core.inliers.clear()
        return outcome

    return track


@pytest.fixture
def leave(scene: Scene, apart: Callable[..., TrackingResult]) -> Callable[..., TrackingResult]:
    """Track a frame that finds few points of the map; what each way ends with."""

    def track(odometry: int, by_words: int = 0, wide: int = 0) -> TrackingResult:
        scene.core.n_map_points = 9
        return apart(odometry, 50, by_words, 50, wide)

    return track


def test_a_sudden_fall_is_not_believed(scene: Scene, leave: Callable[..., TrackingResult]) -> None:
    """More than 20 inliers, but chance finds as many at the edges of the windows."""
    outcome = leave(29)
    assert outcome.state is TrackingState.LOST
    assert outcome.estimate.reason is Reason.WEAK_EVIDENCE
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.verdict is Verdict.REFUSED
    assert outcome.estimate.evidence.inliers_to_usual == pytest.approx(29 / USUAL)
    assert scene.last.T_cw is None


def test_odometry_is_weighed_by_what_the_last_frame_saw(
    scene: Scene, leave: Callable[..., TrackingResult]
) -> None:
    outcome = leave(90)
    assert outcome.state is TrackingState.OK
    assert outcome.estimate.visual_odometry
    evidence = outcome.estimate.evidence
    assert evidence is not None
    assert evidence.verdict is Verdict.STRONG
    assert (evidence.n_predicted, evidence.found) == (200, pytest.approx(90 / 200))
    assert "sightings" not in scene.core.calls, "points of the map are not asked"


def test_when_the_map_vanishes_it_is_searched(
    scene: Scene, leave: Callable[..., TrackingResult]
) -> None:
    """A wrong motion leaves the map from one frame to the next as well."""
    outcome = leave(80, by_words=95)
    assert not outcome.estimate.visual_odometry
    assert outcome.estimate.n_inliers == 95
    evidence = outcome.estimate.evidence
    assert evidence is not None
    assert evidence.doubted
    assert evidence.method is PoseMethod.KEYFRAMES_AROUND
    assert "sightings" not in scene.core.calls, "the map is to stay as it is"


def test_beyond_the_map_odometry_goes_on_without_doubt(
    scene: Scene, leave: Callable[..., TrackingResult]
) -> None:
    assert leave(90).estimate.visual_odometry
    scene.core.calls.clear()
    outcome = scene.track()
    assert outcome.estimate.visual_odometry
    assert outcome.estimate.evidence is not None
    assert not outcome.estimate.evidence.doubted
    assert "align" not in scene.core.calls


def test_points_of_the_frame_before_are_no_pose_in_the_map(scene: Scene) -> None:
    """However many of them are found: they agree with the frame that they come from."""
    outcome = scene.track(map_points=NOT_OF_THE_MAP)
    assert outcome.state is TrackingState.OK
    assert outcome.estimate.visual_odometry
    assert "sightings" not in scene.core.calls
    few = np.where(np.arange(100) < 10, np.arange(100), NOT_OF_THE_MAP)
    assert not scene.track(map_points=few).estimate.visual_odometry


def test_outliers_of_the_map_do_not_count(scene: Scene) -> None:
    wrong = (np.arange(100) < 5).astype(np.uint8)
    points = np.where(np.arange(100) < 12, np.arange(100), NOT_OF_THE_MAP)
    assert scene.track(map_points=points, outlier=wrong).estimate.visual_odometry


def test_a_weak_pose_is_searched_in_the_whole_map(
    scene: Scene, apart: Callable[..., TrackingResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not only one that is refused: nothing else finds the way out of a wrong one."""
    searched: list[int] = []
    search = scene.tracking._search
    original = search.by_relocalization

    def note(frame: FakeFrame, state: State) -> object:
        searched.append(frame.id)
        return original(frame, state)

    monkeypatch.setattr(search, "by_relocalization", note)
    scene.core.n_visible = 2000  # much is in view that is not found
    outcome = apart(50, 45, 50, 40, 50, 40)
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.verdict is Verdict.WEAK
    assert searched == [scene.last.id]
    apart(50, 75)
    assert searched == [scene.last.id - 1], "enough is found"
