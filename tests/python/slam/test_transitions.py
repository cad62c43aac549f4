# SPDX-License-Identifier: BSD-3-Clause
"""The table of transitions: state and event, and the state and the actions that follow."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.slam.config import Config
from orbslam2py.slam.records import TrackingState
from orbslam2py.slam.state import (
    LostSearch,
    LostTime,
    Motion,
    SinceKeyframe,
    State,
    Unconfirmed,
    motion,
)
from orbslam2py.slam.state.transitions import (
    ActivateMap,
    KeyframeInserted,
    MapBegun,
    MapDropped,
    MapLoaded,
    NotFound,
    NotInitialized,
    Relocalized,
    RestartInitializer,
    SearchForMap,
    Tracked,
    Transitions,
)
from support.tracking_scene import FakeCore

NO_IMAGES, NOT_INITIALIZED, OK, LOST = TrackingState
PATIENCE = 2.0
MANY = 1000


def frame(number: int, x: float = 0.0, *, map_index: int = 0) -> Any:
    """A tracked frame, which sees the same points as any other."""
    return SimpleNamespace(
        id=number,
        timestamp=number / 10,
        T_cw=core.Pose([0, 0, 0, 1], [x, 0, 0]),
        map_points=np.arange(100),
        outlier=np.zeros(100, np.uint8),
        reference_keyframe=7,
        big_change=0,
        map_index=map_index,
    )


def transitions() -> Transitions:
    return Transitions(Config(), new_map_after=PATIENCE)


def after(state: State, *events: Any) -> State:
    table = transitions()
    for event in events:
        state, _ = table.next_state(state, event)
    return state


def actions(state: State, event: Any) -> tuple[Any, ...]:
    return transitions().next_state(state, event)[1]


@pytest.fixture(autouse=True)
def frames_without_images(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "core", FakeCore())


NEW = State()
with pytest.MonkeyPatch.context() as patched:
    patched.setattr(motion, "core", FakeCore())
    BEGUN = after(NEW, NotInitialized(), MapBegun(frame(1)))
    FOLLOWED = after(BEGUN, Tracked(frame(2, 1.0), MANY, 0), Tracked(frame(3, 3.0), MANY, 0))
    LOST_STATE = after(FOLLOWED, NotFound(0.4))
    FOUND = after(LOST_STATE, Relocalized(frame(5, 5.0), MANY))
    CONFIRMED = after(FOUND, Tracked(frame(6, 6.0), MANY, 0))


@pytest.mark.parametrize(
    ("before", "event", "phase"),
    [
        (NEW, NotInitialized(), NOT_INITIALIZED),
        (NEW, MapBegun(frame(0)), OK),
        (NEW, MapLoaded(frozenset({0}), None, 3), LOST),
        (BEGUN, Tracked(frame(2), MANY, 0), OK),
        (BEGUN, NotFound(0.2), LOST),
        (FOLLOWED, KeyframeInserted(3, 8), OK),
        (LOST_STATE, NotFound(0.5), LOST),
        (LOST_STATE, SearchForMap(), LOST),
        (LOST_STATE, Relocalized(frame(5), MANY), OK),
        (LOST_STATE, MapBegun(frame(5)), OK),
        (FOUND, NotFound(0.6), LOST),
        (CONFIRMED, NotFound(0.7), LOST),
        (BEGUN, MapDropped(), LOST),
    ],
)
def test_phases(before: State, event: Any, phase: TrackingState) -> None:
    assert after(before, event).phase is phase


def test_a_state_is_never_changed() -> None:
    kept = replace(LOST_STATE)
    after(LOST_STATE, SearchForMap(), MapBegun(frame(5)), NotFound(0.6))
    assert all(getattr(kept, name) is getattr(LOST_STATE, name) for name in vars(kept))


# ---- velocity ------------------------------------------------------------------------------------
def test_the_velocity_is_that_of_two_frames_in_a_row() -> None:
    velocity = FOLLOWED.motion.velocity
    assert velocity is not None
    assert velocity.step.translation[0] == pytest.approx(2.0)
    assert FOLLOWED.motion.last.id == 3
    gap = after(FOLLOWED, Tracked(frame(5, 6.0), MANY, 0))
    assert gap.motion.velocity is None


def test_a_loss_ends_it_and_two_frames_begin_it_again() -> None:
    assert LOST_STATE.motion.velocity is None
    assert LOST_STATE.motion.last.id == 3
    assert FOUND.motion.velocity is None
    velocity = CONFIRMED.motion.velocity
    assert velocity is not None
    assert velocity.step.translation[0] == pytest.approx(1.0)


def test_earlier_frames_of_a_map_give_the_first_one() -> None:
    begun = after(NEW, MapBegun(frame(4, 2.0), (frame(2, 0.0), frame(3, 0.5))))
    velocity = begun.motion.velocity
    assert velocity is not None
    assert velocity.step.translation[0] == pytest.approx(1.5)
    assert after(NEW, MapBegun(frame(4, 2.0))).motion.velocity is None


# ---- losses --------------------------------------------------------------------------------------
def test_a_loss_keeps_its_place() -> None:
    place = LOST_STATE.lost.place
    assert place is not None
    assert (place.last.id, place.reference_keyframe) == (3, 7)
    assert place.velocity is FOLLOWED.motion.velocity
    longer = after(LOST_STATE, NotFound(0.5), NotFound(0.6))
    assert longer.lost.place is place
    assert (LOST_STATE.n_lost, longer.n_lost) == (1, 3)


def test_a_relocalized_frame_waits_for_the_next_one() -> None:
    assert isinstance(FOUND.unconfirmed, Unconfirmed)
    assert FOUND.n_relocalizations == 1
    assert FOUND.lost.place is LOST_STATE.lost.place
    table = transitions()
    assert not table.is_contradicted(FOUND, frame(6, 6.0))
    turned = frame(6)
    turned.T_cw = core.Pose([0, 0.5, 0, np.sqrt(0.75)], [0, 0, 0])
    assert table.is_contradicted(FOUND, turned)
    others = frame(6, 6.0)
    others.map_points = np.arange(1000, 1100)
    assert table.is_contradicted(FOUND, others)
    assert not table.is_contradicted(FOLLOWED, others), "nothing has to be confirmed"
    assert CONFIRMED.unconfirmed is None
    assert CONFIRMED.lost.place is None


def test_a_wrong_one_sends_the_search_back_to_the_old_place() -> None:
    wrong = replace(FOUND, reference_keyframe=99)
    again = after(wrong, NotFound(0.6))
    assert again.motion.last.id == 3
    assert again.reference_keyframe == 7
    assert again.lost is FOUND.lost
    nowhere = after(replace(wrong, lost=LostSearch()), NotFound(0.6))
    assert nowhere.motion.last_frame is None
    assert nowhere.reference_keyframe == -1


def test_a_relocalized_candidate_does_not_survive_a_loss() -> None:
    candidate = replace(FOUND, keyframe_candidate=frame(5))
    assert after(candidate, NotFound(0.6)).keyframe_candidate is None


# ---- several maps --------------------------------------------------------------------------------
@pytest.mark.parametrize(("seconds", "may"), [(PATIENCE - 0.01, False), (PATIENCE, True)])
def test_another_map_may_begin_after_the_patience(seconds: float, may: bool) -> None:
    assert transitions().may_begin_map(LOST_STATE, 0.4 + seconds) is may
    assert not transitions().may_begin_map(FOLLOWED, 1e6)
    never = Transitions(Config(), new_map_after=None)
    assert not never.may_begin_map(LOST_STATE, 1e6)


def test_a_short_success_does_not_end_a_loss() -> None:
    short = after(CONFIRMED, NotFound(0.7))
    assert short.lost_time.lost_since == 0.4
    long_enough = after(FOUND, *(Tracked(frame(n), MANY, 0) for n in range(6, 30)))
    assert long_enough.lost_time == LostTime()


def test_the_initializer_begins_anew_once_and_ends_when_the_camera_is_found() -> None:
    assert actions(LOST_STATE, SearchForMap()) == (RestartInitializer(),)
    seeking = after(LOST_STATE, SearchForMap())
    assert actions(seeking, SearchForMap()) == ()
    found = after(seeking, Relocalized(frame(5), MANY))
    assert found.seeks_map, "not before it is confirmed"
    assert actions(found, Tracked(frame(6), MANY, 0)) == (RestartInitializer(),)
    assert not after(found, Tracked(frame(6), MANY, 0)).seeks_map


def test_a_tracked_frame_ends_a_search_only_if_it_confirms() -> None:
    """Beyond a fixed map frames have a pose by their depths, and are searched in the map."""
    search = LostSearch(failures=3)
    assert after(replace(FOLLOWED, lost=search), Tracked(frame(4), MANY, 0)).lost is search
    assert after(replace(FOUND, lost=search), Tracked(frame(6), MANY, 0)).lost.failures == 0


def test_a_camera_found_in_an_inactive_map_activates_it() -> None:
    there = frame(6, map_index=0)
    assert actions(FOUND, Tracked(there, MANY, active_map=1)) == (ActivateMap(6, 7),)
    assert actions(FOUND, Tracked(there, MANY, active_map=0)) == ()


def test_a_map_beside_others_forgets_the_frames_before() -> None:
    used = replace(LOST_STATE, kept_maps=frozenset({3}), n_uncertain=4, seeks_map=True)
    begun = after(used, MapBegun(frame(30)))
    assert begun.motion.last.id == 30
    assert begun.lost.place is None
    assert begun.lost_time == LostTime()
    assert not begun.seeks_map
    assert begun.n_uncertain == 0
    assert begun.kept_maps == {3}
    assert (begun.tracked_since, begun.found_again) == (30, False)


def test_after_a_map_was_dropped_the_next_image_may_begin_one() -> None:
    dropped = after(FOLLOWED, MapDropped())
    assert dropped.motion.last_frame is None
    assert dropped.seeks_map
    assert transitions().may_begin_map(dropped, -1e9)


def test_a_loaded_map_is_kept_and_its_first_frame_may_become_a_keyframe() -> None:
    guess = core.Pose()
    loaded = after(NEW, MapLoaded(frozenset({0, 2}), guess, spacing=5))
    assert loaded.kept_maps == {0, 2}
    assert loaded.in_loaded_map
    assert loaded.initial_pose is guess
    assert loaded.since_keyframe == SinceKeyframe(-5)
    found = after(loaded, Relocalized(frame(0), MANY))
    assert found.initial_pose is None
    assert not transitions().may_begin_map(loaded, 1e9), "a loaded map is searched for ever"


def test_a_keyframe_is_the_next_reference() -> None:
    inserted = after(
        replace(FOLLOWED, since_keyframe=SinceKeyframe(0, 1, 55)), KeyframeInserted(3, 8)
    )
    assert inserted.reference_keyframe == 8
    assert inserted.since_keyframe == SinceKeyframe(3, 8)


def test_few_inliers_are_noted() -> None:
    few = Config().tracking.scarce_inliers - 1
    assert after(FOLLOWED, Tracked(frame(4), few, 0)).is_scarce
    assert not after(FOLLOWED, Tracked(frame(4), few + 1, 0)).is_scarce
    assert not after(FOLLOWED, Tracked(frame(4), few, 0), NotFound(0.5)).is_scarce


def test_motion_is_forgotten_in_another_map() -> None:
    left = FOLLOWED.in_another_map()
    assert left.motion.last_frame is Motion().last_frame
    assert left.scene.error is FOLLOWED.scene.error
