# SPDX-License-Identifier: BSD-3-Clause
"""Which keyframes may confirm that two maps show the same place; among fakes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.slam.config import MergingConfig
from orbslam2py.slam.merging import MapMerging, map_merging
from orbslam2py.slam.merging.map_merging import explained_share

OLD, YOUNG = 0, 1
#: Keyframes 0 to 9 are of the old map, 20 to 29 of the young one; each shows a place of its own.
STEP = 1.0  # metres from one keyframe to the next
DEPTH = 4.0


def pose(keyframe: int) -> core.Pose:
    return core.Pose(np.array([0.0, 0, 0, 1]), np.array([-STEP * (keyframe % 20), 0.0, 0.0]))


class TwoMaps:
    """Keyframe k + 20 stands where keyframe k does; neither map knows."""

    def map_of(self, keyframe: int) -> int:
        return OLD if keyframe < 20 else YOUNG

    def has_keyframe(self, keyframe: int) -> bool:
        return keyframe not in self.dead

    def keyframe_pose(self, keyframe: int) -> core.Pose:
        return pose(keyframe)

    def best_neighbours(self, keyframe: int, n: int) -> np.ndarray:
        # Far keyframes see too much of each other to name those that stand apart.
        names = [keyframe - 1, keyframe - 2] if keyframe >= 20 else []
        return np.array([k for k in names if k != 20 - 1][:n], np.int64)

    def __init__(self) -> None:
        self.dead: set[int] = set()


def place(current: int, matched: int, off: float = 0.0) -> SimpleNamespace:
    S_cm = (pose(current) @ pose(matched).inverse()).matrix
    S_cm[0, 3] += off
    return SimpleNamespace(
        current=current, matched=matched, S_cm=S_cm, S_cw=S_cm @ pose(matched).matrix
    )


@pytest.fixture
def merging(monkeypatch: pytest.MonkeyPatch) -> MapMerging:
    fakes = SimpleNamespace(
        choose_merge=lambda slam_map, loops, fix_scale: loops[0],
        median_scene_depth=lambda slam_map, keyframe: DEPTH,
    )
    monkeypatch.setattr(map_merging, "core", fakes)
    monkeypatch.setattr(map_merging, "explained_share", lambda *_: 1.0)

    def verify(keyframe: int, candidate: int) -> SimpleNamespace | None:
        near = abs((keyframe - 20) - candidate) <= 1
        return place(keyframe, candidate) if near and keyframe >= 20 else None

    maps = TwoMaps()

    @contextlib.contextmanager
    def lease(keyframe: int) -> Iterator[bool]:
        yield maps.has_keyframe(keyframe)

    return MapMerging(
        maps, verify, lambda _: [], lease, fixes_scale=lambda *_: True, config=MergingConfig()
    )  # type: ignore[arg-type]


def shown(merging: MapMerging, current: int, matched: int, off: float = 0.0) -> bool:
    found = merging.choose([place(current, matched, off)], lambda: [])  # type: ignore[list-item]
    return found is not None


@pytest.mark.parametrize(("share", "believed"), [(0.1, False), (0.2, True)])
def test_what_should_be_seen_must_be_found(
    merging: MapMerging, monkeypatch: pytest.MonkeyPatch, share: float, believed: bool
) -> None:
    """Walls that repeat: the keyframes around agree on the wrong place, but miss most of it."""
    monkeypatch.setattr(map_merging, "explained_share", lambda *_: share)
    assert not shown(merging, 23, 4)
    assert shown(merging, 25, 5) is believed


def test_a_keyframe_that_was_culled_meanwhile_shows_nothing() -> None:
    loop = SimpleNamespace(current=3)
    assert explained_share(core.Map(), loop, 0.87) == 0.0  # type: ignore[arg-type]


def test_a_place_that_was_culled_meanwhile_is_none(merging: MapMerging) -> None:
    assert not shown(merging, 23, 4)
    merging._map.dead.add(5)
    assert not shown(merging, 25, 5)
    merging._map.dead.clear()
    assert shown(merging, 25, 5)


def test_one_keyframe_and_one_neighbour_are_too_few(merging: MapMerging) -> None:
    assert not shown(merging, 24, 4)


def test_what_neighbours_showed_when_they_came_confirms(merging: MapMerging) -> None:
    """Few keyframes, far apart: none of the far keyframe's neighbours is seen by all of them."""
    assert not shown(merging, 23, 4)
    assert shown(merging, 25, 5)


def test_a_place_that_a_neighbour_showed_elsewhere_refuses(merging: MapMerging) -> None:
    assert not shown(merging, 23, 4, off=1.0)
    assert not shown(merging, 25, 5)


def test_places_are_forgotten_with_their_keyframes_and_at_a_reset(merging: MapMerging) -> None:
    assert not shown(merging, 23, 4)
    merging._map.dead.add(4)
    assert not shown(merging, 25, 5)
    merging._map.dead.clear()
    merging.reset()
    assert not shown(merging, 25, 5)
