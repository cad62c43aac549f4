# SPDX-License-Identifier: BSD-3-Clause
"""What has changed in a map since the last look."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from orbslam2py import Sensor
from orbslam2py import _core as core
from orbslam2py.errors import StateError
from orbslam2py.maps import MapChanges, MapFollower
from support.block_wall import DEPTH, HEIGHT, WIDTH, context, texture
from support.map_mirror import MapMirror
from support.small_sequences import new_system, play

pytestmark = pytest.mark.watchdog(60)

SLOTS = 60
LEAST_WEIGHT = 3


@pytest.fixture(scope="module")
def frame() -> core.Frame:
    extraction = core.OrbExtractor(core.OrbOptions(n_features=SLOTS)).extract(texture())
    depth = np.full((HEIGHT, WIDTH), DEPTH, dtype=np.float32)
    return core.build_rgbd_frame(context(), 0, 0.5, extraction, depth)


class Growing:
    """A map of keyframes in a row, and somebody who looks at it."""

    def __init__(self, frame: core.Frame, *, keyframes: int = 0) -> None:
        self.map = core.Map()
        self.frame = frame
        self.follower = MapFollower(self.map, least_weight=LEAST_WEIGHT)
        self.mirror = MapMirror()
        for _ in range(keyframes):
            self.add_keyframe()

    def add_keyframe(self) -> int:
        x = float(len(self.map.keyframe_ids()))
        pose = core.Pose(np.array([0, 0, 0, 1.0]), np.array([-x, 0, 0]))
        added = self.map.add_keyframe(self.frame, pose)
        self.map.publish(added)
        return added

    def add_point(self, slot: int, *observers: int) -> int:
        added = self.map.add_point(np.array([0.0, 0, slot]), observers[0], 0)
        for observer in observers:
            self.map.add_observation(added, observer, slot)
        return added

    def look(self) -> MapChanges:
        changes = self.follower.update()
        self.mirror.apply(changes)
        self.mirror.assert_equals(self.map, LEAST_WEIGHT)
        return changes


def test_first_look_at_an_empty_map_restarts(frame: core.Frame) -> None:
    growing = Growing(frame)
    changes = growing.look()
    assert changes.restarted and changes.map_index == 0 and changes
    assert len(changes.keyframes_set) == len(changes.points_set) == 0
    assert changes.covisibility is not None and changes.covisibility.shape == (0, 2)
    assert changes.loop_edges is not None and changes.loop_edges.shape == (0, 2)
    assert changes.spanning_tree is not None and changes.spanning_tree.shape == (0, 2)


def test_nothing_new_is_nothing(frame: core.Frame) -> None:
    growing = Growing(frame, keyframes=2)
    growing.add_point(0, 0, 1)
    growing.look()
    changes = growing.look()
    assert not changes and not changes.restarted
    assert changes.covisibility is changes.loop_edges is changes.spanning_tree is None
    assert changes.points_set.positions.shape == (0, 3)
    assert changes.keyframes_set.T_wc.shape == (0, 4, 4)


def test_known_answers(frame: core.Frame) -> None:
    growing = Growing(frame, keyframes=2)
    points = [growing.add_point(slot, 0, 1) for slot in range(5)]
    first = growing.look()
    assert first.keyframes_set.ids.tolist() == [0, 1]
    assert first.keyframes_set.parents.tolist() == [-1, 0]
    assert first.keyframes_set.T_wc[1][0, 3] == 1.0
    assert first.keyframes_set.timestamps.tolist() == [0.5, 0.5]
    assert first.points_set.ids.tolist() == points
    assert first.points_set.observation_counts.tolist() == [4] * 5
    assert first.points_set.positions[3].tolist() == [0, 0, 3]

    growing.map.set_position(points[3], np.array([1.0, 2, 3]))
    moved = growing.look()
    assert moved.points_set.ids.tolist() == [points[3]]
    assert moved.points_set.positions.tolist() == [[1, 2, 3]]
    assert len(moved.keyframes_set) == 0

    growing.map.update_connections(1)
    connected = growing.look()
    assert connected.covisibility is not None
    assert connected.covisibility.tolist() == [[0, 1]]
    assert connected.loop_edges is None

    growing.map.replace_point(points[0], points[4])
    growing.map.erase_point(points[1])
    merged = growing.look()
    assert merged.points_removed.tolist() == points[:2]

    third = growing.add_keyframe()
    growing.map.add_loop_edge(0, third)
    looped = growing.look()
    assert looped.loop_edges is not None and looped.loop_edges.tolist() == [[0, third]]
    assert looped.spanning_tree is not None
    assert looped.spanning_tree.tolist() == [[1, 0], [third, 1]]

    assert growing.map.erase_keyframe(1)
    died = growing.look()
    assert died.keyframes_removed.tolist() == [1]
    assert died.covisibility is not None and len(died.covisibility) == 0
    assert died.spanning_tree is not None and died.spanning_tree.tolist() == [[third, 0]]


def test_what_comes_and_goes_between_two_looks_is_never_heard_of(frame: core.Frame) -> None:
    growing = Growing(frame, keyframes=2)
    growing.look()
    growing.map.erase_point(growing.add_point(0, 0, 1))
    growing.map.erase_keyframe(growing.add_keyframe())
    changes = growing.look()
    assert len(changes.points_removed) == len(changes.keyframes_removed) == 0


def test_another_map_restarts(frame: core.Frame) -> None:
    growing = Growing(frame, keyframes=3)
    growing.add_point(0, 0, 1)
    growing.look()
    growing.map.clear()
    growing.add_keyframe()
    changes = growing.look()
    assert changes.restarted and changes.map_index == 1
    assert changes.keyframes_set.ids.tolist() == [0]
    assert changes.loop_edges is not None


class Edits:
    """Random changes of a map by each of its verbs."""

    def __init__(self, growing: Growing, seed: int) -> None:
        self.growing, self.map = growing, growing.map
        self.random = np.random.default_rng(seed)
        self.points: list[int] = []

    def keyframe(self) -> int:
        return int(self.random.choice(self.map.keyframe_ids()))

    def point(self) -> int:
        living = [p for p in self.points if self.map.has_point(p)]
        return int(self.random.choice(living)) if living else self.add_point()

    def add_point(self) -> int:
        observers = self.random.choice(self.map.keyframe_ids(), 3, replace=False).tolist()
        slots = set(range(SLOTS // 2))
        for observer in observers:
            slots &= set(np.flatnonzero(self.map.keyframe_points(observer) < 0).tolist())
        added = self.growing.add_point(min(slots, default=0), *observers)
        self.points.append(added)
        return added

    def edit(self) -> None:
        x = self.random.normal(size=3)
        match int(self.random.integers(12)):
            case 0:
                self.map.add_keyframe(self.growing.frame, core.Pose(np.array([0, 0, 0, 1.0]), x))
            case 1:
                self.map.publish(self.keyframe())
            case 2:
                self.map.set_pose(self.keyframe(), core.Pose(np.array([0, 0, 0, 1.0]), x))
            case 3:
                self.map.set_position(self.point(), x)
            case 4 if len(self.map.keyframe_ids()) > 4:
                self.map.erase_keyframe(self.keyframe())
            case 5:
                self.map.erase_observation(self.point(), self.keyframe())
            case 6:
                self.map.erase_point(self.point())
            case 7:
                self.map.replace_point(self.point(), self.point())
            case 8:
                self.map.update_connections(self.keyframe())
            case 9 if self.random.random() < 0.1:
                a, b = self.keyframe(), self.keyframe()
                if a != b:
                    self.map.add_loop_edge(a, b)
            case 10:
                child, parent = self.keyframe(), self.keyframe()
                if child != 0:
                    try:
                        self.map.set_parent(child, parent)
                    except StateError:  # a circle
                        assert child == parent or self.map.parent(parent) >= 0
            case _:
                self.add_point()


@pytest.mark.parametrize("seed", range(6))
def test_a_follower_knows_the_map_after_any_changes(frame: core.Frame, seed: int) -> None:
    growing = Growing(frame, keyframes=4)
    edits = Edits(growing, seed)
    for _ in range(40):
        for _ in range(int(edits.random.integers(1, 25))):
            edits.edit()
        growing.look()


def test_the_map_of_a_system_is_followed() -> None:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        slam_map = system.pipeline.back_end.map
        follower, mirror = MapFollower(slam_map), MapMirror()
        for first in range(0, 40, 8):
            play(system, 8, first)
            mirror.apply(follower.update())
            mirror.assert_equals(slam_map, 100)
        assert len(mirror.keyframes) > 2 and len(mirror.points) > 100
        system.reset()
        play(system, 2, 40)
        changes = follower.update()
        assert changes.restarted and changes.map_index == 1
        mirror.apply(changes)
        mirror.assert_equals(slam_map, 100)


def test_changes_are_printed_in_one_line(frame: core.Frame) -> None:
    growing = Growing(frame, keyframes=2)
    growing.add_point(0, 0, 1)
    assert repr(growing.look()) == (
        "<MapChanges: map 0 from the beginning, keyframes +2 -0, points +1 -0, "
        "new covisibility, loop edges, spanning tree>"
    )
    assert repr(growing.look()) == "<MapChanges: map 0, keyframes +0 -0, points +0 -0>"


def test_a_follower_changes_nothing() -> None:
    hashes = []
    for followed in (False, True):
        with new_system(Sensor.RGBD, deterministic=True) as system:
            follower = MapFollower(system.pipeline.back_end.map)
            for index in range(24):
                play(system, 1, index)
                if followed:
                    follower.update()
            hashes.append(system.map_hash())
    assert hashes[0] == hashes[1]


def test_a_map_is_followed_by_another_thread_while_it_grows() -> None:
    with new_system(Sensor.RGBD, wait_for_mapping=True) as system:
        slam_map = system.pipeline.back_end.map
        follower, mirror = MapFollower(slam_map), MapMirror()
        done = threading.Event()
        looks = []

        def follow() -> None:
            while not done.is_set():
                changes = follower.update()
                looks.append(changes)
                mirror.apply(changes)

        watcher = threading.Thread(target=follow)
        watcher.start()
        try:
            play(system, 30)
            assert system.wait_until_idle(20)
        finally:
            done.set()
            watcher.join()
        mirror.apply(follower.update())
        mirror.assert_equals(slam_map, 100)
    assert sum(map(bool, looks)) > 2
