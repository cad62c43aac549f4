# SPDX-License-Identifier: BSD-3-Clause
"""Blur neither begins a single camera's map nor bends it while it is young."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from orbslam2py import Reason, Sensor, TrackingState
from orbslam2py.slam.config import AcceptanceConfig, InitializationConfig
from orbslam2py.slam.evidence import smear as smear_module
from orbslam2py.slam.evidence.smear import Smear
from orbslam2py.slam.initialization import MonocularInitializer, from_views
from orbslam2py.slam.records import TrackingOutcome
from orbslam2py.slam.relocalization import LossClock
from support.tracking_scene import FakeCore, FakeFrame, Scene, lose

SHARP, BLURRED = 1.4, 0.5  # fine detail; the latter is a smear of 22 pixels
YOUNG = AcceptanceConfig().young_map


def track_blurred(scene: Scene, frame_id: int | None = None) -> TrackingOutcome:
    scene.core.fine_detail_of_images = BLURRED
    outcome = scene.track(frame_id)
    scene.core.fine_detail_of_images = SHARP
    return outcome


# ---- a young map ---------------------------------------------------------------------------------
def test_a_young_map_believes_no_blurred_image(single: Scene) -> None:
    outcome = track_blurred(single)
    assert (outcome.state, outcome.estimate.reason) == (TrackingState.LOST, Reason.TOO_BLURRED)
    assert single.last.T_cw is None
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.smear > 20


def test_the_images_before_the_map_say_what_is_sharp(
    core: FakeCore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first image that is tracked may be blurred already."""
    scene = Scene(Sensor.MONOCULAR, core)
    initializer: Any = scene.tracking._initializer
    monkeypatch.setattr(initializer, "remembered", lambda: [FakeFrame(0).features])
    scene.track()
    assert track_blurred(scene).estimate.reason is Reason.TOO_BLURRED
    assert track_blurred(scene).estimate.reason is Reason.TOO_BLURRED


def test_it_goes_on_with_the_next_sharp_one(single: Scene) -> None:
    track_blurred(single)
    assert single.track().state is TrackingState.OK


def test_a_little_blur_is_believed(single: Scene) -> None:
    single.core.fine_detail_of_images = 0.9 * SHARP
    assert single.track().state is TrackingState.OK


def test_it_is_young_for_a_second_of_images(single: Scene) -> None:
    single.run(YOUNG - 2)
    assert track_blurred(single, frame_id=YOUNG).estimate.reason is Reason.TOO_BLURRED
    single.run(2)
    assert track_blurred(single).state is TrackingState.OK


def test_another_map_is_not_young(single: Scene) -> None:
    younger: Any = single.last
    single.tracking._belief.begin_map(younger, 7)
    assert track_blurred(single).state is TrackingState.OK


def test_depths_hold_a_map_from_the_first_image_on(core: FakeCore, sensor: Sensor) -> None:
    scene = Scene(sensor, core)
    scene.run(2)
    assert track_blurred(scene).state is TrackingState.OK


def test_a_blurred_image_leads_no_lost_camera_back(single: Scene) -> None:
    single.run(2 * YOUNG)
    lose(single)
    assert track_blurred(single).estimate.reason is Reason.TOO_BLURRED
    assert single.track().state is TrackingState.OK


def test_images_that_stay_without_detail_are_believed_in_the_end(single: Scene) -> None:
    """A lens that is out of focus now."""
    single.run(2 * YOUNG)
    lose(single)
    states = [track_blurred(single).state for _ in range(300)]
    first = states.index(TrackingState.OK)
    assert 20 < first < 50
    assert set(states[:first]) == {TrackingState.LOST}


# ---- after a map that came to nothing ------------------------------------------------------------
def test_the_next_map_is_held_to_the_sharpness_of_the_one_before(
    single: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    initializer: Any = single.tracking._initializer
    before: Any = SimpleNamespace(id=single.last.id)
    monkeypatch.setattr(initializer, "remembered", lambda: [before])
    monkeypatch.setattr(initializer, "restart", lambda frames: None)
    single.tracking.restart()
    assert track_blurred(single).state is TrackingState.OK  # begins the map: not asked here
    assert track_blurred(single).estimate.reason is Reason.TOO_BLURRED


# ---- the first views -----------------------------------------------------------------------------
class Starter(MonocularInitializer):
    """Begins a map with the next image that may, once it is willing."""

    willing = False

    def __init__(self) -> None:
        nothing: Any = None
        super().__init__(
            nothing,
            nothing,
            nothing,
            0,
            Smear(500.0, AcceptanceConfig()),
            config=InitializationConfig(),
        )

    def _from_best_pair(self, frame: Any) -> Reason:
        return Reason.NONE if self.willing else Reason.LOW_PARALLAX


class FakeViews:
    """Follows all images and keeps those that it is asked to."""

    def __init__(self) -> None:
        self.views: list[Any] = []
        self._last: Any = None

    def clear(self) -> None:
        self.views = []

    def follow(self, frame: Any) -> None:
        self._last = frame

    def keep_last(self) -> None:
        self.views.append(SimpleNamespace(frame=self._last))


@pytest.fixture
def starter(monkeypatch: pytest.MonkeyPatch) -> Starter:
    def detail(frame: Any) -> float:
        return float(frame.detail)

    monkeypatch.setattr(smear_module, "core", SimpleNamespace(fine_detail=detail))
    monkeypatch.setattr(from_views, "KeptViews", lambda limits: FakeViews())
    monkeypatch.setattr(from_views, "core", FakeCore())
    return Starter()


def shown(starter: Starter, detail: float, frame_id: int = 0, *, blurred: bool = False) -> Reason:
    frame: Any = FakeFrame(frame_id)
    frame.features.detail = detail
    return starter.try_initialize(frame, blurred=blurred)


def test_no_map_begins_with_a_blurred_image(starter: Starter) -> None:
    assert shown(starter, SHARP) is Reason.FIRST_VIEW
    starter.willing = True
    assert shown(starter, BLURRED, 1) is Reason.TOO_BLURRED_TO_BEGIN
    assert shown(starter, SHARP, 2) is Reason.NONE


def test_nor_from_one(starter: Starter) -> None:
    shown(starter, SHARP, 0)
    shown(starter, BLURRED, 1)
    shown(starter, SHARP, 2)
    assert [view.frame.frame_id for view in starter._kept.views] == [0, 2]


def test_nor_with_one_that_lost_what_those_right_before_it_had(starter: Starter) -> None:
    """However much the sharpest of all had."""
    shown(starter, SHARP, 0)
    starter.willing = True
    assert shown(starter, SHARP, 1, blurred=True) is Reason.TOO_BLURRED_TO_BEGIN
    starter.willing = False
    shown(starter, SHARP, 2)
    assert [view.frame.frame_id for view in starter._kept.views] == [0, 2]


def test_nor_after_a_map_that_came_to_nothing(starter: Starter) -> None:
    shown(starter, SHARP, 0)
    shown(starter, SHARP, 1, blurred=True)
    frame: Any = FakeFrame(2)
    frame.features.detail = SHARP
    starter.remember(frame, blurred=True)
    shown(starter, SHARP, 3)
    starter.restart(starter.remembered())
    assert [view.frame.frame_id for view in starter._kept.views] == [0, 3]


def test_after_a_map_that_came_to_nothing_the_images_before_it_are_still_known(
    single: Scene,
) -> None:
    single.run(8)
    single.tracking.restart()
    single.initializer.refusals = 1
    single.core.sharpnesses.append(300.0)
    single.core.fine_detail_of_images = 0.5 * SHARP
    single.track()
    assert single.initializer.blurred[-1]


def test_while_lost_another_map_is_to_begin_with_no_blurred_image_either(single: Scene) -> None:
    single.run(40)
    lose(single)
    single.tracking._loss = LossClock(0.0)
    single.tracking._loss.be_overdue()
    single.initializer.refusals = 9
    single.core.sharpnesses.append(300.0)
    single.core.fine_detail_of_images = 0.5 * SHARP
    n_shown = len(single.initializer.blurred)
    assert single.track().estimate.reason is Reason.BLURRED
    assert single.initializer.blurred[n_shown:] == [True], "it follows the image"


def test_images_before_the_map_are_compared_with_those_before_them(core: FakeCore) -> None:
    scene = Scene(Sensor.MONOCULAR, core)
    scene.initializer.refusals = 8
    fine = core.fine_detail_of_images
    for i in range(8):
        is_dull = i in (2, 6)
        core.sharpnesses.append(300.0 if is_dull else 1000.0)
        core.fine_detail_of_images = 0.5 * fine if is_dull else fine
        assert scene.track().state is TrackingState.NOT_INITIALIZED
    # The third image has too few before it.
    assert [i for i, blurred in enumerate(scene.initializer.blurred) if blurred] == [6]


def test_what_was_sharp_is_known_where_another_map_begins(starter: Starter) -> None:
    shown(starter, SHARP)
    starter.restart([])
    assert shown(starter, BLURRED) is Reason.TOO_BLURRED_TO_BEGIN


def test_what_was_sharp_is_known_after_a_map_that_came_to_nothing(starter: Starter) -> None:
    shown(starter, SHARP)
    frames = starter.remembered()
    starter.reset()
    starter.restart(frames)
    assert shown(starter, BLURRED, 1) is Reason.TOO_BLURRED_TO_BEGIN


def test_a_blurred_image_of_before_is_no_view(starter: Starter) -> None:
    sharp, blurred = FakeFrame(0).features, FakeFrame(1).features
    sharp.detail, blurred.detail = SHARP, BLURRED
    starter.restart([sharp, blurred])
    assert [view.frame.frame_id for view in starter._kept.views] == [0]


def test_a_camera_that_is_found_again_still_knows_what_is_sharp(
    single: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    initializer: Any = single.tracking._initializer
    restarts: list[object] = []
    monkeypatch.setattr(initializer, "restart", restarts.append)
    monkeypatch.setattr(initializer, "reset", lambda: pytest.fail("forgets it"))
    single.tracking._seeks_map = True
    single.tracking._stay(single.last)
    assert restarts == [[]]


def test_a_reset_forgets_it(starter: Starter) -> None:
    shown(starter, SHARP)
    starter.reset()
    assert shown(starter, BLURRED) is Reason.FIRST_VIEW
