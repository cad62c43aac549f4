# SPDX-License-Identifier: BSD-3-Clause
"""None for an object that is needed is a TypeError; for one that may be missing it is taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from orbslam2py import _core as core
from support.block_wall import context, some_frame, ten_words


def restorer() -> core.MapRestorer:
    slam_map = core.Map()
    slam_map.publish(slam_map.add_keyframe(some_frame(), core.Pose()))
    contents = core.map_contents(slam_map)
    made = core.MapRestorer(contents, len(contents["keyframes.keypoints"]), vocabulary=None)
    made.add(contents, 1)
    return made


NOBODY: Any = None
PIXELS = np.zeros((0, 2), np.float32)
NEEDED: dict[str, Callable[[], object]] = {
    # Whatever is shared with C++, which holds it by a pointer.
    "TrackedFrame": lambda: core.TrackedFrame(NOBODY),
    "FrameContext": lambda: core.FrameContext(NOBODY, context().scales),
    "MapFollower": lambda: core.MapFollower(NOBODY),
    "Map.add_keyframe": lambda: core.Map().add_keyframe(NOBODY, core.Pose()),
    "match_views, first": lambda: core.match_views(NOBODY, some_frame(), PIXELS),
    "match_views, current": lambda: core.match_views(some_frame(), NOBODY, PIXELS),
    # By reference.
    "describe": lambda: core.describe(NOBODY, ten_words()),
    "describe, vocabulary": lambda: core.describe(some_frame(), NOBODY),
    "index_keyframe": lambda: core.index_keyframe(NOBODY, core.Map(), 0),
    "index_keyframe, map": lambda: core.index_keyframe(core.KeyFrameIndex(), NOBODY, 0),
    "insert_keyframe": lambda: core.insert_keyframe(core.Map(), NOBODY, True),
    "FrameSightings.keep": lambda: core.FrameSightings().keep(NOBODY),
    "TrackedFrame.share_anchor": lambda: core.TrackedFrame(some_frame()).share_anchor(NOBODY),
    "MapRestorer.finish": lambda: restorer().finish(NOBODY),
    # In a list.
    "choose_loop": lambda: core.choose_loop(core.Map(), [NOBODY], True),
    "choose_merge": lambda: core.choose_merge(core.Map(), [NOBODY], True),
    "World": lambda: core.World([NOBODY]),
    "LoopConsistency.update": lambda: core.LoopConsistency().update(core.Map(), [NOBODY]),
    "spread_from_seam": lambda: core.spread_from_seam(
        core.Map(), core.poses_of_map(core.Map(), 0), [NOBODY], True
    ),
    "solve_bundle": lambda: core.solve_bundle(
        [NOBODY], [True], context().camera, np.zeros((0, 3)), [], [], np.zeros((0, 3)), []
    ),
    "solve_bundle, camera": lambda: core.solve_bundle(
        [], [], NOBODY, np.zeros((0, 3)), [], [], np.zeros((0, 3)), []
    ),
    "PnpRansac": lambda: core.PnpRansac(np.zeros((4, 3)), np.zeros((4, 2)), np.ones(4), NOBODY),
    "solve_epnp": lambda: core.solve_epnp(np.zeros((4, 3)), np.zeros((4, 2)), NOBODY),
}


@pytest.mark.parametrize("name", NEEDED)
def test_an_object_that_is_needed(name: str) -> None:
    with pytest.raises(TypeError, match="incompatible"):
        NEEDED[name]()


def test_objects_that_may_be_missing() -> None:
    slam_map = core.Map()
    options = core.NewPointOptions()
    assert len(core.create_new_points(slam_map, 0, options, None)) == 0
    assert core.local_bundle_adjustment(slam_map, 0, None).n_points == 0
    bundle = core.gather_full_bundle(slam_map)
    assert core.solve_full_bundle(bundle, abort=None).iterations == 0
    seam = core.poses_of_map(slam_map, 0)
    assert core.spread_from_seam(slam_map, seam, [], True, None) is False
    restorer().finish(slam_map, None)
    tracked = core.TrackedFrame(some_frame())
    tracked.T_cw = None
    assert tracked.T_cw is None
