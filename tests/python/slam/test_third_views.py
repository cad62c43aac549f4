# SPDX-License-Identifier: BSD-3-Clause
"""Which views are asked what they say of a motion, and by which keypoints; among fakes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization import initial_views
from orbslam2py.slam.initialization.initial_views import Indices, InitialViews, View
from orbslam2py.slam.initialization.third_view import Candidate, Motion, ThirdViews

LIMITS = InitializationConfig()
N = 200
"""Keypoints of every frame."""


def frame(number: int, shift: float = 0.0) -> core.Frame:
    """All of its keypoints have moved by so many pixels."""
    places = np.stack([np.arange(N) * 10.0 + shift, np.zeros(N)], axis=1).astype(np.float32)
    pinhole = SimpleNamespace(cx=1000.0, cy=100.0)
    fake = SimpleNamespace(
        id=number, size=N, keypoints=places, camera=SimpleNamespace(pinhole=pinhole)
    )
    return cast(core.Frame, fake)


def only(first: int, end: int) -> Indices:
    """Matches of the keypoints in between with those of the same number."""
    every = np.arange(N, dtype=np.int32)
    return np.where((every >= first) & (every < end), every, -1).astype(np.int32)


def view(number: int, matches: Indices, shift: float, last_shift: float) -> View:
    """A view some of whose keypoints are matched with the last frame."""
    made = View(frame(number, shift))
    made.matches = matches
    made.positions = made.keypoints + np.array([last_shift - shift, 0.0], np.float32)
    made.displacement = abs(last_shift - shift)
    return made


def candidate(of: View, placed: Indices) -> Candidate:
    motion = SimpleNamespace(triangulated=(placed >= 0).astype(np.uint8))
    return Candidate(of, (cast(Motion, motion),))


def kept(views: list[View], distant: list[View]) -> InitialViews:
    made = InitialViews(LIMITS)
    made.views, made.distant = views, distant
    return made


# ---- partners ------------------------------------------------------------------------------------
def test_partners_by_the_last_frame() -> None:
    old, new = view(1, only(0, 60), 0, 20), view(2, only(40, 120), 10, 20)
    expected = only(40, 60)
    np.testing.assert_array_equal(old.partners(new), expected)
    np.testing.assert_array_equal(old.all_partners(new), expected)


def test_partners_by_what_was_matched_while_the_newer_was_the_last() -> None:
    old, new = view(1, only(0, 80), 0, 10), view(2, only(40, 120), 10, 20)
    shifted = np.where(old.matches >= 0, old.matches + 1, -1).astype(np.int32)
    old.matches = shifted
    old.link(new)
    old.matches = only(0, 50)
    # 40 to 49 by the last frame; else number k was matched with k + 1, where that is free.
    expected = np.where(only(40, 50) >= 0, only(40, 50), shifted)
    expected[39] = -1
    np.testing.assert_array_equal(old.all_partners(new), expected)
    backwards = new.all_partners(old)
    np.testing.assert_array_equal(backwards[40:50], np.arange(40, 50))
    np.testing.assert_array_equal(backwards[51:81], np.arange(50, 80))
    assert (backwards[[50, *range(81, N)]] == -1).all()


def test_partners_are_one_to_one() -> None:
    """Of two that claim the same keypoint that of the last frame has it."""
    old, new = view(1, only(0, 80), 0, 10), view(2, only(40, 120), 10, 20)
    old.matches = np.where(only(0, 80) >= 0, np.arange(N) + 1, -1).astype(np.int32)
    old.link(new)
    old.matches = only(60, 70)
    partners = old.all_partners(new)
    claimed = partners[partners >= 0]
    assert len(np.unique(claimed)) == len(claimed)
    np.testing.assert_array_equal(partners[60:70], np.arange(60, 70))
    assert partners[59] == -1, "it was linked to 60"


def test_views_without_a_match_have_no_partners() -> None:
    nothing = np.full(N, -1, np.int32)
    old, new = view(1, nothing, 0, 20), view(2, nothing, 10, 20)
    assert (old.all_partners(new) == -1).all()
    assert (new.all_partners(old) == -1).all()


# ---- which are asked -----------------------------------------------------------------------------
def test_near_views_are_asked_where_one_sees_enough() -> None:
    first = view(2, only(0, 150), 10, 30)
    third = view(1, only(0, 40), 0, 30)
    thirds = ThirdViews.of(
        candidate(first, only(0, 150)), kept([third, first], [view(0, only(0, 30), -5, 30)]), LIMITS
    )
    assert [asked.view for asked in thirds.views] == [third]
    assert thirds.fewest_common == 30


def test_where_none_sees_enough_more_count() -> None:
    """29 points by the last frame; 45 more were matched when the first view was the last frame."""
    first = view(2, only(0, 150), 10, 30)
    third, distant = view(1, only(0, 29), 0, 30), view(0, only(0, 25), -5, 30)
    third.matches = only(0, 75)
    third.link(first)
    third.matches = only(0, 29)
    which = candidate(first, only(0, 150))
    thirds = ThirdViews.of(which, kept([third, first], [distant]), LIMITS)
    assert [asked.view for asked in thirds.views] == [distant, third]
    assert [np.count_nonzero(asked.partners >= 0) for asked in thirds.views] == [25, 75]
    assert all(thirds.asks(which, asked) for asked in thirds.views)


@pytest.mark.parametrize(("n_common", "is_asked"), [(19, False), (20, True)])
def test_twenty_points_are_asked_for(n_common: int, is_asked: bool) -> None:
    first, third = view(2, only(0, 150), 10, 30), view(1, only(0, n_common), 0, 30)
    which = candidate(first, only(0, 150))
    thirds = ThirdViews.of(which, kept([third, first], []), LIMITS)
    assert thirds.fewest_common == 20
    assert [thirds.asks(which, asked) for asked in thirds.views] == [is_asked]


@pytest.mark.parametrize(("shift", "lies_between"), [(9.0, False), (5.0, True), (27.0, False)])
def test_it_must_differ_from_both_by_what_all_three_see(shift: float, lies_between: bool) -> None:
    """Its own median says otherwise: most of what it sees lies far away and has hardly moved."""
    first, third = view(2, only(0, 150), 10, 30), view(1, only(0, 25), shift, 30)
    third.displacement = 1.0
    thirds = ThirdViews.of(candidate(first, only(0, 150)), kept([third, first], []), LIMITS)
    assert bool(thirds.views) is lies_between


# ---- which are kept ------------------------------------------------------------------------------
class FakeCore:
    """Matches as many keypoints of each frame as it is told."""

    def __init__(self) -> None:
        self.n_matched: dict[int, int] = {}
        #: By the frame that views are matched with: these, whatever the view.
        self.shown: dict[int, Indices] = {}

    def match_views(self, view: core.Frame, last: core.Frame, *_: object, **__: object) -> Indices:
        if last.id in self.shown and view.id in self.n_matched:
            return self.shown[last.id]
        return only(0, self.n_matched.get(view.id, N))


@pytest.fixture
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeCore:
    fake = FakeCore()
    monkeypatch.setattr(initial_views, "core", fake)
    return fake


def follow(views: InitialViews, n_frames: int, first: int = 0) -> None:
    for i in range(first, first + n_frames):
        views.follow(frame(i, 10.0 * i))
        views.keep_last()


def test_a_view_with_few_matches_stays_to_confirm(matcher: FakeCore) -> None:
    views = InitialViews(LIMITS)
    follow(views, 3)
    matcher.n_matched = {0: 99, 1: 30}
    follow(views, 1, first=3)
    assert [kept.frame.id for kept in views.views] == [2, 3]
    assert [kept.frame.id for kept in views.distant] == [0, 1]
    matcher.n_matched = {0: 120, 1: 29}
    follow(views, 1, first=4)
    # Once it has lost so much it begins no map any more.
    assert [kept.frame.id for kept in views.distant] == [0]
    assert [kept.frame.id for kept in views.views] == [2, 3, 4]
    views.clear()
    assert (views.views, views.distant) == ([], [])


def test_the_last_few_of_them_stay(matcher: FakeCore) -> None:
    views = InitialViews(LIMITS)
    follow(views, 6)
    matcher.n_matched = dict.fromkeys(range(5), 50)
    follow(views, 1, first=6)
    assert [kept.frame.id for kept in views.distant] == [2, 3, 4]
    # What the next frame shows of the last of them is another thing.
    matcher.shown[7] = only(100, 150)
    follow(views, 1, first=7)
    distant, last_but_one = views.distant[-1], views.views[-2]
    assert (distant.frame.id, last_but_one.frame.id) == (4, 6)
    assert np.count_nonzero(distant.partners(last_but_one) >= 0) == 50
    assert np.count_nonzero(distant.all_partners(last_but_one) >= 0) == 100


def test_what_was_noted_of_views_that_are_gone_is_forgotten(matcher: FakeCore) -> None:
    views = InitialViews(LIMITS)
    follow(views, 100)
    kept = {view.frame.id for view in (*views.views, *views.distant)}
    assert all(set(view._linked) <= kept for view in views.views)
    assert len(views.views[0]._linked) == len(views.views) - 1
