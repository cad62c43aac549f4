# SPDX-License-Identifier: BSD-3-Clause
"""Monocular maps, full bundle adjustment and temporary points as Python sees them."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import StateError
from orbslam2py import _core as core
from support.block_wall import DEPTH, HEIGHT, WIDTH, context, ten_words, texture

SHIFT = 4  # pixels between the two views


@pytest.fixture
def vocabulary() -> core.Vocabulary:
    return ten_words()


def view(shift: int, *, depth: float | None = None) -> core.TrackedFrame:
    """A frame `shift` centimetres to the right, without a pose."""
    camera = context(bf=0.0 if depth is None else 25.0)
    extraction = core.OrbExtractor(core.OrbOptions(n_features=600)).extract(texture(shift))
    if depth is None:
        frame = core.build_monocular_frame(camera, shift, shift / 10.0, extraction)
    else:
        metres = np.full((HEIGHT, WIDTH), depth, dtype=np.float32)
        frame = core.build_rgbd_frame(camera, shift, shift / 10.0, extraction, metres)
    return core.TrackedFrame(frame)


class TwoViews:
    """The wall from two places, with the reconstruction in units of the baseline."""

    def __init__(self, vocabulary: core.Vocabulary) -> None:
        self.initial, self.current = view(0), view(SHIFT)
        for tracked in (self.initial, self.current):
            core.describe(tracked.features, vocabulary)
        pixels = self.initial.features.keypoints
        # Those of level 0, which lie at the same place of the wall in both.
        self.matches = core.match_views(
            self.initial.features,
            self.current.features,
            pixels,
            window=20,
            level_difference=0,
            highest_level=0,
        )
        z = 100.0 * DEPTH / SHIFT
        rays = np.column_stack([(pixels - (160.0, 120.0)) / 250.0, np.ones(len(pixels))])
        depths = z * np.random.default_rng(2).uniform(0.9, 1.1, (len(pixels), 1))
        self.points = depths * rays
        self.T_21 = core.Pose(np.array([0, 0, 0, 1.0]), np.array([-1.0, 0, 0]))

    def create(self, world: core.Map, min_points: int = 30) -> core.MonocularMap:
        return core.create_monocular_map(
            world, self.initial, self.current, self.T_21, self.matches, self.points, min_points
        )


@pytest.fixture
def views(vocabulary: core.Vocabulary) -> TwoViews:
    return TwoViews(vocabulary)


def test_monocular_map(views: TwoViews) -> None:
    world = core.Map()
    made = views.create(world)
    n = int(np.count_nonzero(views.matches >= 0))
    assert made.ok and made.failure == core.MonocularMapFailure.NONE
    assert (made.first, made.second, world.n_keyframes) == (0, 1, 2)
    assert made.n_points == world.n_points == n > 30
    assert made.summary.final_cost < 1e-3 * made.summary.initial_cost
    assert core.median_scene_depth(world, 0) == pytest.approx(1.0, abs=1e-6)
    assert views.current.T_cw is not None
    np.testing.assert_array_equal(
        views.current.T_cw.matrix, world.keyframe_pose(made.second).matrix
    )
    assert views.current.reference_keyframe == made.second
    assert core.count_map_points(views.current) == n
    assert core.check_invariants(world, require_words=True) == []

    recent = core.RecentPoints()
    for keyframe in (made.first, made.second):
        core.process_new_keyframe(world, keyframe, recent)
    np.testing.assert_array_equal(np.sort(recent.ids), world.point_ids())
    with pytest.raises(StateError, match="clear"):
        views.create(world)


def test_failed_monocular_map(views: TwoViews) -> None:
    world = core.Map()
    made = views.create(world, 10_000)
    assert not made.ok
    assert made.failure == core.MonocularMapFailure.FEW_POINTS
    assert world.n_keyframes == 0
    assert views.current.T_cw is None
    world.clear()
    assert views.create(world).ok
    with pytest.raises(ValueError, match="points"):
        core.create_monocular_map(
            core.Map(), views.initial, views.current, views.T_21, views.matches, views.points[1:]
        )


def test_full_bundle_adjustment(views: TwoViews) -> None:
    world = core.Map()
    assert views.create(world).ok
    rng = np.random.default_rng(3)
    for point in world.point_ids():
        world.set_position(point, world.point_position(point) + rng.uniform(-0.01, 0.01, 3))
    before = world.content_hash()

    bundle = core.gather_full_bundle(world)
    assert (bundle.n_keyframes, bundle.n_points) == (2, world.n_points)
    assert bundle.n_observations == 2 * world.n_points
    assert not bundle.solved
    assert not core.commit_full_bundle(world, bundle).committed
    late = core.FullBundleOptions(max_seconds=1e-9)
    summary = core.solve_full_bundle(bundle, late)
    assert summary.timed_out and not bundle.solved
    assert world.content_hash() == before

    flag = core.StopFlag()
    flag.set()
    summary = core.solve_full_bundle(bundle, abort=flag)
    assert summary.aborted and not bundle.solved
    assert not core.commit_full_bundle(world, bundle).committed

    summary = core.solve_full_bundle(bundle, core.FullBundleOptions(iterations=15))
    assert bundle.solved and not summary.timed_out
    assert summary.final_cost < 0.1 * summary.initial_cost
    assert world.content_hash() == before
    world.erase_point(world.point_ids()[0])
    commit = core.commit_full_bundle(world, bundle)
    assert commit.committed
    assert (commit.n_followed_keyframes, commit.n_followed_points) == (0, 0)
    np.testing.assert_array_equal(world.keyframe_pose(0).matrix, np.eye(4))
    assert world.big_change_index == 1
    assert core.check_invariants(world, require_words=True) == []
    assert not core.commit_full_bundle(world, bundle).committed  # once


def test_temporary_points() -> None:
    last, current = view(0, depth=DEPTH), view(SHIFT, depth=DEPTH)
    world = core.Map()
    last.T_cw = core.Pose()
    current.T_cw = core.Pose(np.array([0, 0, 0, 1.0]), np.array([-SHIFT / 100.0, 0, 0]))
    points = core.gather_points(world, last.map_points)
    n = core.add_temporary_points(last, points)
    assert n == len(points) == last.features.size > 100
    assert (points.ids >= core.FIRST_TEMPORARY_POINT).all()
    np.testing.assert_allclose(points.positions[:, 2], DEPTH, rtol=1e-6)
    matched = core.match_last_frame(current, last, points, 15.0, True)
    assert matched == current.n_associated() > 100
    core.select_local_map(world, current)
    assert current.n_associated() == matched
    assert core.optimize_pose(current).n_inliers > 100
    assert core.count_map_points(current) == 0
    assert core.discard_temporary(current) == matched
    assert current.n_associated() == 0
    last.T_cw = None
    with pytest.raises(StateError, match="no pose"):
        core.add_temporary_points(last, points)


def test_scene_depth_of_a_keyframe_without_points() -> None:
    """The original reads before the start of a list (OD-59)."""
    world = core.Map()
    keyframe = world.add_keyframe(view(0).features, core.Pose())
    assert core.median_scene_depth(world, keyframe) is None
    with pytest.raises(KeyError, match="not in the map"):
        core.median_scene_depth(world, 7)
