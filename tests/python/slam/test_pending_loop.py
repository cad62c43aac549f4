# SPDX-License-Identifier: BSD-3-Clause
"""A loop that few matches hold waits a few keyframes for one with more."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from orbslam2py.slam import pending_loop
from orbslam2py.slam.config import LoopConfig
from orbslam2py.slam.pending_loop import PendingLoop

FIRM, PATIENCE = LoopConfig().firm_matches, pending_loop._PATIENCE


class World:
    """A map that knows which keyframes live, and what is leased."""

    def __init__(self) -> None:
        self.big_change_index = 0
        self.dead: set[int] = set()
        self.leases: list[int] = []
        slam_map: Any = self
        self.n_verified = 0
        #: Of a loop that is verified again; 0: it is none any more.
        self.matches_now = 77
        self.waiting = PendingLoop(slam_map, self.verify, self.leases.remove, LoopConfig())

    def verify(self, current: int, matched: int) -> Any:
        self.n_verified += 1
        n_matches = self.matches_now
        found = SimpleNamespace(current=current, matched=matched, n_matches=n_matches)
        return found if n_matches else None

    def begin_lease(self, keyframe: int) -> None:
        self.leases.append(keyframe)

    def has_keyframe(self, keyframe: int) -> bool:
        return keyframe not in self.dead

    def ask(self, current: int, n_matches: int | None = None) -> tuple[int, int] | None:
        """Keyframe and matches of the loop to close after a keyframe with this loop, or none."""
        found: Any = None
        if n_matches is not None:
            found = SimpleNamespace(current=current, matched=0, n_matches=n_matches)
        with self.waiting.ripe(found) as loop:
            if loop is None:
                return None
            assert self.leases == [loop.current], "it must not die meanwhile"
            return loop.current, loop.n_matches


@pytest.fixture
def world() -> World:
    return World()


def test_a_firm_loop_does_not_wait(world: World) -> None:
    assert world.ask(20, FIRM) == (20, FIRM)
    assert world.leases == []


def test_a_weak_one_gives_way_to_the_first_firm_one(world: World) -> None:
    assert world.ask(20, 58) is None
    assert world.leases == [20]
    assert world.ask(21) is None
    assert world.ask(22, 112) == (22, 112)
    assert world.leases == []
    assert world.ask(23) is None


def test_after_some_keyframes_the_best_is_closed(world: World) -> None:
    loops = {20: 58, 21: 70, 23: 60}
    told = [world.ask(k, loops.get(k)) for k in range(20, 20 + PATIENCE + 1)]
    assert told == [None] * PATIENCE + [(21, 70)]
    assert world.ask(40) is None, "it is closed once"


def test_without_another_it_is_closed_all_the_same(world: World) -> None:
    told = [world.ask(20, 58), *(world.ask(21 + k) for k in range(PATIENCE))]
    assert told == [None] * PATIENCE + [(20, 58)]


def test_the_next_one_waits_anew(world: World) -> None:
    test_without_another_it_is_closed_all_the_same(world)
    assert world.ask(50, 58) is None


def test_when_no_keyframe_follows_it_is_closed(world: World) -> None:
    world.ask(20, 58)
    with world.waiting.last() as loop:
        assert loop is not None
        assert loop.current == 20
    assert world.leases == []
    with world.waiting.last() as loop:
        assert loop is None


@pytest.mark.parametrize("dead", [20, 0])
def test_with_a_dead_keyframe_it_is_dropped(world: World, dead: int) -> None:
    world.ask(20, 58)
    world.dead.add(dead)
    assert [world.ask(21 + k) for k in range(PATIENCE)] == [None] * PATIENCE
    assert world.leases == []


@pytest.mark.parametrize("matches_now", [77, 0])
def test_in_a_map_that_moved_it_is_verified_again(world: World, matches_now: int) -> None:
    world.ask(20, 58)
    world.matches_now = matches_now
    world.big_change_index += 1
    told = [world.ask(21 + k) for k in range(PATIENCE)]
    assert told == [None] * (PATIENCE - 1) + [(20, 77) if matches_now else None]
    assert world.n_verified == 1
    assert world.leases == []


def test_in_one_that_stayed_it_is_not(world: World) -> None:
    test_without_another_it_is_closed_all_the_same(world)
    assert world.n_verified == 0


def test_dropped_it_is_not_closed(world: World) -> None:
    world.ask(20, 58)
    world.waiting.drop()
    assert world.leases == []
    assert [world.ask(21 + k) for k in range(PATIENCE)] == [None] * PATIENCE


def test_the_lease_ends_with_an_error_too(world: World) -> None:
    found: Any = SimpleNamespace(current=20, matched=0, n_matches=FIRM)
    with pytest.raises(ZeroDivisionError), world.waiting.ripe(found):
        raise ZeroDivisionError
    assert world.leases == []


def test_one_that_is_none_any_more_gives_way_to_a_weaker_one(world: World) -> None:
    world.ask(20, 90)
    world.matches_now = 0
    world.big_change_index += 1
    told = [world.ask(21, 85), *(world.ask(22 + k) for k in range(PATIENCE))]
    assert told == [None] * PATIENCE + [(21, 85)]
    assert world.leases == []


def test_so_does_one_whose_place_died(world: World) -> None:
    found: Any = SimpleNamespace(current=20, matched=3, n_matches=90)
    with world.waiting.ripe(found):
        world.dead.add(3)
    told = [world.ask(21, 85), *(world.ask(22 + k) for k in range(PATIENCE))]
    assert told == [None] * PATIENCE + [(21, 85)]
