# SPDX-License-Identifier: BSD-3-Clause
"""Several maps in one store: whatever is done to them, in any order, the rules of a map hold."""

from __future__ import annotations

from functools import cache

from hypothesis import given, settings
from hypothesis import strategies as st

from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

_CHOICES = st.tuples(st.integers(0, 6), st.integers(0, 10_000), st.integers(0, 10_000))


@cache
def some_frame() -> core.Frame:
    options = SyntheticOptions(world="corridor", sensor="rgbd", size=(320, 240), frames=1)
    sequence = SyntheticSequence(options)
    images = sequence.load(0)
    front_end = FrontEnd(sequence.settings, sequence.sensor)
    return front_end.rgbd(images.image, images.depth, 0, 0.0, StageTimer(), None)


class Store:
    """A map of the core, changed by choices."""

    def __init__(self) -> None:
        self.map = core.Map()
        self.n_keypoints = 0

    def keyframe(self, choice: int, of_map: int = -1) -> int | None:
        ids = self.map.keyframe_ids(of_map).tolist()
        return ids[choice % len(ids)] if ids else None

    def add_keyframe(self) -> None:
        slam_map = self.map
        before = self.keyframe(-1, slam_map.active_map)
        added = slam_map.add_keyframe(some_frame(), core.Pose())
        slam_map.publish(added)
        if before is not None:
            for slot in range(20):
                point = slam_map.add_point([0.0, 0.0, 5.0], added, 0)
                slam_map.add_observation(point, added, slot)
                slam_map.add_observation(point, before, 100 + slot)
            slam_map.update_connections(added)

    def do(self, what: int, first: int, second: int) -> None:
        slam_map = self.map
        maps = slam_map.maps
        if what <= 1 or not maps:
            self.add_keyframe()
        elif what == 2:
            slam_map.begin_map()
            self.add_keyframe()
        elif what == 3:
            active = maps[first % len(maps)]
            assert slam_map.activate_map_of(slam_map.root(active)) == active
        elif what == 4 and len(maps) > 1:
            slam_map.erase_map(maps[first % len(maps)])
        elif what == 5 and len(maps) > 1:
            child, parent = self.keyframe(first, maps[-1]), self.keyframe(second, maps[0])
            assert child is not None
            assert parent is not None
            slam_map.join_maps(child, parent)
            assert slam_map.map_of(child) == maps[0]
        elif what == 6:
            keyframe = self.keyframe(first)
            assert keyframe is not None
            was_root = keyframe == slam_map.root(slam_map.map_of(keyframe))
            assert slam_map.erase_keyframe(keyframe) is not was_root


@settings(max_examples=60, deadline=None)
@given(st.lists(_CHOICES, max_size=30))
def test_the_rules_hold_whatever_is_done(choices: list[tuple[int, int, int]]) -> None:
    store = Store()
    for choice in choices:
        store.do(*choice)
        slam_map = store.map
        assert core.check_invariants(slam_map, require_words=False) == []
        assert slam_map.active_map in slam_map.maps
        assert sum(map(slam_map.n_keyframes_of, slam_map.maps)) == slam_map.n_keyframes
        assert sum(map(slam_map.n_points_of, slam_map.maps)) == slam_map.n_points
        assert sorted(slam_map.maps, key=slam_map.root) == slam_map.maps, "older roots come first"
