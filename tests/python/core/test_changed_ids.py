# SPDX-License-Identifier: BSD-3-Clause
"""Ids of what has changed in a map since a moment, as writers of the map ask for them."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core as core
from support.block_wall import DEPTH, HEIGHT, WIDTH, context, texture


@pytest.fixture
def slam_map() -> core.Map:
    """Two keyframes and four points that both see."""
    extraction = core.OrbExtractor(core.OrbOptions(n_features=40)).extract(texture())
    depth = np.full((HEIGHT, WIDTH), DEPTH, dtype=np.float32)
    made = core.Map()
    for k in range(2):
        frame = core.build_rgbd_frame(context(), k, k / 10.0, extraction, depth)
        made.publish(made.add_keyframe(frame, core.Pose()))
    for slot in range(4):
        point = made.add_point(np.zeros(3), 0, 0)
        made.add_observation(point, 0, slot)
        made.add_observation(point, 1, slot)
    return made


def test_since_the_beginning_everything_has_changed(slam_map: core.Map) -> None:
    changed = core.changed_since(slam_map, core.MapStamp())
    assert not changed.restarted
    assert changed.keyframes.tolist() == [0, 1]
    assert changed.points.tolist() == [0, 1, 2, 3]
    assert changed.stamp == core.stamp_of(slam_map) != core.MapStamp()


def test_since_a_moment(slam_map: core.Map) -> None:
    before = core.stamp_of(slam_map)
    slam_map.set_position(2, np.ones(3))
    slam_map.erase_point(1)
    changed = core.changed_since(slam_map, before)
    assert changed.points.tolist() == [2]
    assert changed.points_removed.tolist() == [1]
    assert len(changed.keyframes) == 0
    slam_map.set_pose(1, core.Pose())
    changed = core.changed_since(slam_map, changed.stamp)
    assert changed.keyframes.tolist() == [1]
    assert len(changed.points) == len(changed.keyframes_removed) == 0


def test_another_map_is_listed_whole(slam_map: core.Map) -> None:
    before = core.stamp_of(slam_map)
    frame = slam_map.keyframe_frame(0)
    slam_map.clear()
    slam_map.add_keyframe(frame, core.Pose())
    changed = core.changed_since(slam_map, before)
    assert changed.restarted and changed.keyframes.tolist() == [0]


def test_what_a_keyframe_saw(slam_map: core.Map) -> None:
    assert slam_map.keyframe_frame(1).timestamp == 0.1
    with pytest.raises(KeyError, match="keyframe 7"):
        slam_map.keyframe_frame(7)
