# SPDX-License-Identifier: BSD-3-Clause
"""Which keyframes a lost frame is compared with, and where it may have gone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import _core
from orbslam2py.slam.relocalization import CandidatePlaces, candidates
from orbslam2py.slam.state import MOTION_FRAMES, LastKnownPose, LostSearch, loss

FRAME: Any = SimpleNamespace()


class FakeMap:
    """Keyframes 0 to 99; neighbours of each are those right before it, or there are none."""

    def __init__(self, *, neighbours: bool = False) -> None:
        self.dead: set[int] = set()
        self._neighbours = neighbours

    def has_keyframe(self, keyframe: int) -> bool:
        return keyframe not in self.dead

    def living(self, keyframe: int) -> int:
        return -1 if keyframe in self.dead else keyframe

    def best_neighbours(self, keyframe: int, n: int) -> np.ndarray:
        first = max(0, keyframe - n) if self._neighbours else keyframe
        return np.arange(first, keyframe)[::-1]

    def map_of(self, keyframe: int) -> int:
        return 0

    def keyframe_ids(self, map_index: int) -> np.ndarray:
        assert map_index == 0
        return np.arange(100)


class FakeCore:
    """Names the keyframes that look like the next frame, with their scores."""

    Pose = _core.Pose

    def __init__(self) -> None:
        self.found: dict[int, float] = {}
        self.stretched = 1.0

    def find_relocalization_candidates(self, *_: object) -> list[SimpleNamespace]:
        return [SimpleNamespace(keyframe=k, group_score=s) for k, s in sorted(self.found.items())]

    def follow_map(self, *_: object) -> tuple[str, float, None]:
        return "points", self.stretched, None


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeCore:
    fake = FakeCore()
    for module in (candidates, loss):
        monkeypatch.setattr(module, "core", fake)
    return fake


class Places:
    """Chooses keyframes for one lost frame after the other."""

    def __init__(self, slam_map: FakeMap) -> None:
        given: Any = slam_map
        index: Any = "index"
        self._places = CandidatePlaces(given, index)
        self._lost = LostSearch()

    def of(self, place: LastKnownPose | None, failures: int) -> list[int]:
        lost = replace(self._lost, place=place, failures=failures)
        keyframes, self._lost = self._places.of(FRAME, lost)
        return keyframes


SPEED = _core.Velocity(_core.Pose([0, 0, 0, 1], [0.5, 0, 0]), 0.1)


def frame_at(number: int, x: float = 0.0) -> Any:
    """A frame of a camera that takes ten images a second."""
    T_cw = _core.Pose([0, 0, 0, 1], [x, 0, 0])
    return SimpleNamespace(id=number, timestamp=number / 10, T_cw=T_cw)


def lost_at(keyframe: int, velocity: _core.Velocity | None = None) -> LastKnownPose:
    return LastKnownPose(frame_at(10, 5.0), velocity, keyframe)


def test_the_most_similar_come_first(fake: FakeCore) -> None:
    fake.found = {3: 0.1, 7: 0.5, 9: 0.3}
    assert Places(FakeMap()).of(None, 0) == [7, 9, 3]


def test_equal_ones_come_by_id(fake: FakeCore) -> None:
    fake.found = {9: 0.3, 3: 0.3}
    assert Places(FakeMap()).of(None, 0) == [3, 9]


def test_what_several_frames_look_like_comes_before_what_one_does(fake: FakeCore) -> None:
    chosen = Places(FakeMap())
    fake.found = {3: 0.3, 4: 0.1}
    chosen.of(None, 0)
    fake.found = {3: 0.3, 8: 0.4}
    assert chosen.of(None, 1) == [3, 8, 4], "4 is remembered"
    fake.found = {}
    for _ in range(candidates._WORD_FRAMES - 1):
        remembered = chosen.of(None, 2)
    assert remembered == [8, 3]
    assert chosen.of(None, 3) == [], "not for longer than some frames"


def test_the_dead_are_left_out(fake: FakeCore) -> None:
    slam_map = FakeMap()
    chosen = Places(slam_map)
    fake.found = {3: 0.3, 8: 0.4}
    chosen.of(None, 0)
    slam_map.dead.add(8)
    fake.found = {}
    assert chosen.of(None, 1) == [3]


def test_the_number_is_bounded_and_all_are_reached_in_the_end(fake: FakeCore) -> None:
    fake.found = {k: 1.0 - k / 100 for k in range(40)}
    chosen, place = Places(FakeMap(neighbours=True)), lost_at(80)
    reached: set[int] = set()
    for failures in range(20):
        tried = chosen.of(place, failures)
        assert len(tried) <= candidates._WORD_CANDIDATES + candidates._NEAR_CANDIDATES
        assert tried[:4] == [0, 1, 2, 3], "the best are tried every time"
        reached.update(tried)
    near = {80, *range(70, 80), *range(95, 100)}
    assert reached == set(range(40)) | near


def test_the_place_of_loss_is_searched_without_any_word(fake: FakeCore) -> None:
    assert Places(FakeMap(neighbours=True)).of(lost_at(80), 0)[:2] == [80, 79]


def test_few_places_bring_their_neighbours_in_turns(fake: FakeCore) -> None:
    fake.found = {20: 0.5, 50: 0.3}
    chosen = Places(FakeMap(neighbours=True))
    assert chosen.of(None, 0) == [20, 50, 19, 49, 18, 48, 17, 47]
    reached = {k for failures in range(6) for k in chosen.of(None, failures)}
    assert reached == {20, 50, *range(10, 20), *range(40, 50)}


def test_a_place_that_died_names_nothing(fake: FakeCore) -> None:
    slam_map = FakeMap()
    slam_map.dead.add(80)
    assert Places(slam_map).of(lost_at(80), 0) == []


# ---- guesses -----------------------------------------------------------------------------------
def test_the_camera_went_on_or_stayed() -> None:
    place = lost_at(80, velocity=SPEED)
    went_on, stayed = place.guesses(frame_at(13))
    assert went_on.translation[0] == pytest.approx(5.0 + 3 * 0.5)
    assert stayed.translation[0] == 5.0


def test_after_a_while_nobody_knows_where_it_went() -> None:
    place = lost_at(80, velocity=SPEED)
    assert len(place.guesses(frame_at(10 + MOTION_FRAMES))) == 2
    assert len(place.guesses(frame_at(11 + MOTION_FRAMES))) == 1


def test_a_motion_is_stretched_with_the_map(fake: FakeCore) -> None:
    place = lost_at(80, velocity=SPEED)
    slam_map: Any = FakeMap()
    fake.stretched = 2.0
    place = place.following(slam_map)
    assert place.velocity is not None
    assert place.velocity.step.translation[0] == 1.0
