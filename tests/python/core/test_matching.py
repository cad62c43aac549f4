# SPDX-License-Identifier: BSD-3-Clause
"""Matching, new points and fusion as Python sees them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from orbslam2py import StateError
from orbslam2py import _core as core
from support.block_wall import DEPTH, HEIGHT, WIDTH, context, ten_words, texture


class Scene:
    """Frames along a wall that is parallel to the image plane."""

    def __init__(self) -> None:
        self.context = context()
        self.vocabulary = ten_words()
        self.map = core.Map()
        self.recent = core.RecentPoints()

    def frame(self, shift: int, *, depth: float = DEPTH) -> core.TrackedFrame:
        extraction = core.OrbExtractor(core.OrbOptions(n_features=400)).extract(texture(shift))
        metres = np.full((HEIGHT, WIDTH), depth, dtype=np.float32)
        frame = core.build_rgbd_frame(self.context, shift, shift / 10.0, extraction, metres)
        core.describe(frame, self.vocabulary)
        tracked = core.TrackedFrame(frame)
        tracked.T_cw = core.Pose(np.array([0, 0, 0, 1.0]), np.array([-shift / 100.0, 0, 0]))
        return tracked

    def keyframe(self, shift: int, *, create_points: bool = True) -> int:
        frame = self.frame(shift)
        keyframe = int(core.insert_keyframe(self.map, frame, create_points))
        core.process_new_keyframe(self.map, keyframe, self.recent)
        return keyframe

    def point_pixels(self, frame: core.TrackedFrame) -> npt.NDArray[np.float64]:
        """Distances in pixels between associated keypoints and their points, as projected."""
        held = frame.map_points >= 0
        p = frame.positions[held] + np.array([-frame.id / 100.0, 0, 0])
        uv = 250.0 * p[:, :2] / p[:, 2:] + np.array([160.0, 120.0])
        return np.linalg.norm(uv - frame.features.keypoints[held], axis=1)


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_last_frame(scene: Scene) -> None:
    scene.keyframe(0)
    last = scene.frame(0)
    points = core.gather_points(scene.map, scene.map.point_ids())
    assert core.match_local_map(last, points, np.zeros(0, np.int64), 3.0).n_matches > 200
    current = scene.frame(4)
    n = core.match_last_frame(current, last, points, radius=15.0, use_depth=True)
    assert n == current.n_associated() > 100
    assert np.median(scene.point_pixels(current)) < 2.0
    current.T_cw = None
    with pytest.raises(StateError, match="no pose"):
        core.match_last_frame(current, last, points, 15.0, True)


def test_local_map(scene: Scene) -> None:
    scene.keyframe(0)
    points = core.gather_points(scene.map, scene.map.point_ids())
    frame = scene.frame(4)
    uvr, cosine, level, visible = core.project_into(frame, points)
    assert uvr.shape == (len(points), 3)
    assert (cosine[visible] > 0.5).all()
    assert ((level >= 0) & (level < 8)).all()
    excluded = np.sort(points.ids[visible][:7])
    matches = core.match_local_map(frame, points, excluded, 3.0)
    assert matches.n_matches == frame.n_associated() > 100
    np.testing.assert_array_equal(
        matches.visible, points.ids[visible & ~np.isin(points.ids, excluded)]
    )
    assert not np.isin(frame.map_points, excluded).any()
    assert "visible" in repr(matches)


def test_keyframe_by_projection(scene: Scene) -> None:
    keyframe = scene.keyframe(0)
    frame = scene.frame(4)
    found = scene.map.point_ids()[:5]
    n = core.match_keyframe_by_projection(scene.map, keyframe, frame, found, 10.0, 100)
    assert n == frame.n_associated() > 100
    assert not np.isin(frame.map_points, found).any()
    with pytest.raises(StateError, match="ascending"):
        core.match_keyframe_by_projection(scene.map, keyframe, frame, found[::-1], 10.0, 100)
    with pytest.raises(ValueError, match="1-D"):
        core.match_keyframe_by_projection(scene.map, keyframe, frame, found[:, None], 10.0, 100)


def test_by_words(scene: Scene) -> None:
    a, b = scene.keyframe(0), scene.keyframe(6)
    frame = scene.frame(3)
    assert core.match_keyframe_by_words(scene.map, a, frame, 0.7) == frame.n_associated() > 50
    pairs = core.match_keyframes_by_words(scene.map, a, b, ratio=0.75)
    assert pairs.dtype == np.int64
    assert len(pairs) > 50
    assert (np.diff(pairs[:, 0]) > 0).all()
    assert len(np.unique(pairs[:, 1])) == len(pairs)


def test_views(scene: Scene) -> None:
    first, second = scene.frame(0).features, scene.frame(6).features
    matches = core.match_views(first, second, first.keypoints, window=50.0)
    found = matches >= 0
    assert (matches.shape, matches.dtype) == ((len(first),), np.int32)
    assert np.count_nonzero(found) > 40
    moved = first.keypoints[found] - second.keypoints[matches[found]]
    assert np.median(moved[:, 0]) == pytest.approx(6.0, abs=0.5)
    with pytest.raises(ValueError, match=r"\(n, 2\)"):
        core.match_views(first, second, first.keypoints[:, :1])
    with pytest.raises(StateError, match="one position per keypoint"):
        core.match_views(first, second, first.keypoints[:3])


def linked_keyframes(scene: Scene) -> tuple[int, int]:
    """Two keyframes 30 cm apart; the second observes half of what it could."""
    a = scene.keyframe(0)
    frame = scene.frame(30)
    points = core.gather_points(scene.map, scene.map.point_ids()[::4])
    assert core.match_local_map(frame, points, np.zeros(0, np.int64), 3.0).n_matches > 15
    b = int(core.insert_keyframe(scene.map, frame, False))
    core.process_new_keyframe(scene.map, b, scene.recent)
    assert scene.map.weight(a, b) > 15
    return a, b


def test_new_points(scene: Scene) -> None:
    a, b = linked_keyframes(scene)
    free = scene.frame(60)
    points = core.gather_points(scene.map, scene.map.keyframe_points(b))
    core.match_local_map(free, points, np.zeros(0, np.int64), 3.0)
    c = int(core.insert_keyframe(scene.map, free, False))
    core.process_new_keyframe(scene.map, c, scene.recent)
    options = core.NewPointOptions(monocular=False, n_neighbours=5)
    flag = core.StopFlag()
    created = core.create_new_points(scene.map, c, options, flag)
    assert len(created) > 0
    depths = np.array([scene.map.point_position(point)[2] for point in created])
    assert np.median(depths) == pytest.approx(DEPTH, rel=0.01)
    assert np.abs(depths / DEPTH - 1).max() < 0.1  # corners of coarse levels are off by a pixel
    assert core.create_new_points(scene.map, c, options).dtype == np.int64
    assert core.check_invariants(scene.map, True) == []
    assert a in scene.map.keyframe_ids()


def test_fusion(scene: Scene) -> None:
    a, b = linked_keyframes(scene)
    before = scene.map.weight(a, b)
    assert core.fuse_with_neighbours(scene.map, b, 10) > 0
    assert scene.map.weight(a, b) > before
    assert core.check_invariants(scene.map, True) == []


def test_options_have_the_documented_defaults() -> None:
    options = core.NewPointOptions()
    assert (options.monocular, options.n_neighbours) == (False, 10)
    options.n_neighbours = 20
    assert options.n_neighbours == 20
