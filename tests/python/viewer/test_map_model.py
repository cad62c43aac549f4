# SPDX-License-Identifier: BSD-3-Clause
"""The map as a viewer remembers it: pages, what is stale, colours, and paths beside it."""

from __future__ import annotations

import time

import numpy as np
import pytest

from orbslam2py import Trajectory
from orbslam2py.maps.changes import KeyframesSet, MapChanges, PointsSet
from orbslam2py.viewer.map_model import KEYFRAME_IDS, POINT_IDS, MapModel
from orbslam2py.viewer.paths import MAX_CORNERS, lay_truth, pieces
from orbslam2py.viewer.point_colours import ColourBy, PointColours

NONE = np.zeros(0, np.int64)
PAIRS = np.zeros((0, 2), np.int64)


def changes(
    points: np.ndarray = NONE,
    keyframes: np.ndarray = NONE,
    *,
    restarted: bool = False,
    points_removed: np.ndarray = NONE,
    keyframes_removed: np.ndarray = NONE,
    covisibility: np.ndarray | None = None,
    shift: float = 0.0,
) -> MapChanges:
    """Points and keyframes that lie at their ids along x."""
    T_wc = np.tile(np.eye(4), (len(keyframes), 1, 1))
    T_wc[:, 0, 3] = keyframes + shift
    positions = np.column_stack([points + shift, 0 * points, 0 * points]).astype(float)
    return MapChanges(
        map_index=0,
        restarted=restarted,
        keyframes_set=KeyframesSet(keyframes, T_wc, keyframes / 10, keyframes - 1),
        keyframes_removed=keyframes_removed,
        points_set=PointsSet(points, positions, np.full(len(points), 3)),
        points_removed=points_removed,
        covisibility=covisibility,
        loop_edges=None,
        spanning_tree=None,
    )


@pytest.fixture
def model() -> MapModel:
    model = MapModel()
    ids = np.arange(0, 3 * POINT_IDS, 2)
    pairs = np.column_stack([np.arange(199), np.arange(1, 200)])
    model.apply(changes(ids, np.arange(200), restarted=True, covisibility=pairs))
    return model


def test_only_pages_that_changed_are_stale(model: MapModel) -> None:
    assert model.take_stale().everything
    assert model.n_points == 3 * POINT_IDS // 2
    moved, new = np.array([4, POINT_IDS + 6]), np.array([POINT_IDS + 7])
    both = np.sort(np.concatenate([moved, new]))
    model.apply(changes(both, shift=0.5, points_removed=np.array([10])))
    stale = model.take_stale()
    assert stale.points == {0, 1}
    assert not stale.everything
    assert not stale.keyframes
    assert model.n_points == 3 * POINT_IDS // 2
    assert model.positions_of(np.array([4, 10, POINT_IDS + 7]))[:, 0].tolist() == [
        4.5,
        POINT_IDS + 7.5,
    ]
    for page in model.points.values():
        assert (np.diff(page.ids) > 0).all()


def test_edges_are_stale_where_a_keyframe_moved(model: MapModel) -> None:
    model.take_stale()
    model.apply(changes(keyframes=np.array([3]), shift=0.25))
    stale = model.take_stale()
    assert stale.keyframes == {0}
    assert stale.covisibility == {0}
    ends = model.edges_in_page(model.covisibility, 0)
    assert len(ends) == KEYFRAME_IDS - 1
    assert ends[2, 1, 0] == 3.25


def test_a_culled_keyframe_takes_its_edges_along(model: MapModel) -> None:
    model.take_stale()
    left = model.covisibility[(model.covisibility != 150).all(axis=1)]
    model.apply(changes(keyframes_removed=np.array([150]), covisibility=left))
    stale = model.take_stale()
    assert stale.keyframes == stale.covisibility == {150 // KEYFRAME_IDS}
    assert 150 not in model.keyframe_ids
    assert len(model.rows_of(np.array([[149, 150], [148, 149]]))) == 1


def test_another_map_forgets_everything(model: MapModel) -> None:
    model.apply(changes(np.arange(5), np.arange(2), restarted=True, covisibility=PAIRS))
    assert model.take_stale().everything
    assert model.n_points == 5
    assert len(model.keyframe_ids) == 2


def test_a_large_map_is_followed_for_little() -> None:
    """500 000 points, 5000 keyframes: an update of what mapping touches, far below a frame."""
    model = MapModel()
    everything = np.arange(500_000)
    model.apply(changes(everything, np.arange(5000), restarted=True, covisibility=PAIRS))
    model.take_stale()
    seconds = []
    for n in range(5):
        begin = time.process_time()
        model.apply(changes(everything[-3000:], np.arange(4970, 5000), shift=0.01 * n))
        seconds.append(time.process_time() - begin)
        assert len(model.take_stale().points) <= 2
    assert min(seconds) < 0.05


def test_points_have_the_colour_in_which_they_were_seen_first(model: MapModel) -> None:
    red, blue = np.array([[255, 0, 0]], np.uint8), np.array([[0, 0, 255]], np.uint8)
    assert model.colour_points(np.array([2]), red) == {0}
    assert model.colour_points(np.array([2]), blue) == set()
    colours = PointColours(model)
    assert colours.of_page(0)[1].tolist() == [255, 0, 0]


@pytest.mark.parametrize("by", list(ColourBy))
def test_every_way_to_colour_gives_a_colour_for_every_point(by: ColourBy, model: MapModel) -> None:
    colours = PointColours(model)
    colours.by = by
    colours.update_span()
    assert colours.of_page(1).shape == (POINT_IDS // 2, 3)
    if by is ColourBy.AGE:
        assert colours.of_page(0)[0].tolist() != colours.of_page(2)[-1].tolist()


def test_a_path_is_cut_at_gaps_however_much_it_is_thinned() -> None:
    n = 5 * MAX_CORNERS
    positions = np.column_stack([np.arange(n), np.zeros(n), np.zeros(n)]).astype(float)
    gaps = np.zeros(n, bool)
    gaps[[0, 7003, 7004]] = True
    lines = pieces(positions, gaps)
    assert len(lines) < MAX_CORNERS + 5
    assert not ((lines[:, 0, 0] < 7003) & (lines[:, 1, 0] >= 7003)).any()
    assert lines[-1, 1, 0] == n - 1
    assert (lines[1:, 0, 0] >= lines[:-1, 1, 0]).all()


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_the_truth_is_laid_over_the_estimate(scale: float) -> None:
    times = np.arange(60.0)
    true = np.column_stack([np.cos(times / 9), np.sin(times / 7), times / 60])
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    T_wc = np.tile(np.eye(4), (60, 1, 1))
    T_wc[:, :3, 3] = scale * true @ turn.T + [1, 2, 3]
    T_true = np.tile(np.eye(4), (60, 1, 1))
    T_true[:, :3, 3] = true
    laid = lay_truth(times, T_wc[:, :3, 3], Trajectory(times, T_true), with_scale=scale != 1.0)
    assert laid is not None
    assert laid.error < 1e-9
    assert np.allclose(laid.positions, T_wc[:, :3, 3])
    assert (
        lay_truth(times[:2], T_wc[:2, :3, 3], Trajectory(times, T_true), with_scale=False) is None
    )
