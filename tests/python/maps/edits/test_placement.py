# SPDX-License-Identifier: BSD-3-Clause
"""Maps laid into worlds that are known otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbslam2py import MapFileError, Trajectory
from orbslam2py.maps import (
    MapContents,
    place_by_length,
    place_by_points,
    place_by_trajectory,
    transform_map,
)
from orbslam2py.trajectory import Similarity
from support.made_up_map import made_up_map


def known(scale: float, seed: int = 0) -> Similarity:
    random = np.random.default_rng(seed)
    return Similarity(scale, Rotation.random(random_state=seed).as_matrix(), random.normal(size=3))


def truth_of(contents: MapContents, similarity: Similarity) -> Trajectory:
    keyframes = contents.keyframes
    return Trajectory(keyframes.timestamps, similarity.apply_to_poses(keyframes.T_wc))


@hypothesis_settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 999), scale=st.floats(0.1, 30), depth=st.booleans())
def test_the_transform_is_found(seed: int, scale: float, depth: bool) -> None:
    contents = made_up_map(6, 40, depth=depth)
    wanted = known(1.0 if depth else scale, seed)
    found = place_by_trajectory(contents, truth_of(contents, wanted))
    np.testing.assert_allclose(found.similarity.R, wanted.R, atol=1e-7)
    np.testing.assert_allclose(found.similarity.t, wanted.t, atol=1e-6)
    assert found.similarity.scale == pytest.approx(wanted.scale, rel=1e-9)
    assert (found.n_pairs, found.on_a_line) == (6, False)
    assert found.rmse < 1e-9 * wanted.scale


def test_a_map_with_metres_keeps_them() -> None:
    contents = made_up_map(depth=True)
    found = place_by_trajectory(contents, truth_of(contents, known(2.0)))
    assert found.similarity.scale == 1.0
    assert found.rmse > 0.1


def test_lost_poses_and_other_times_do_not_count() -> None:
    contents = made_up_map()
    truth = truth_of(contents, known(2.0))
    wrong = truth.T_wc.copy()
    wrong[2, :3, 3] += 100
    lost = Trajectory(truth.timestamps, wrong, np.arange(8) == 2)
    late = np.where(np.arange(8) == 5, 0.03, 0.0)
    found = place_by_trajectory(contents, Trajectory(lost.timestamps + late, wrong, lost.lost))
    assert found.n_pairs == 6
    assert found.rmse < 1e-9


def test_too_few_poses() -> None:
    contents = made_up_map()
    truth = truth_of(contents, known(1.0)).select(np.arange(2))
    with pytest.raises(MapFileError, match=r"only 2 of 8 keyframes.*truth of the sequence"):
        place_by_trajectory(contents, truth)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_points_on_a_line_are_refused(size: float) -> None:
    """However large the map is: the turn around the line would be made up."""
    contents = made_up_map()
    line = size * np.outer(np.arange(5.0), [1.0, 2.0, 0.5])
    beside = size * np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [1, 0.1, 0]])
    with pytest.raises(MapFileError, match=r"on a line in the map, .* well beside the line"):
        place_by_points(contents, line, beside)
    with pytest.raises(MapFileError, match="on a line in the world, "):
        place_by_points(contents, beside, line + 1e-5 * size)
    assert not place_by_points(contents, beside, 3 * beside).on_a_line


def test_points_that_tell_nothing() -> None:
    contents = made_up_map()
    with pytest.raises(MapFileError, match="all at one place"):
        place_by_points(contents, np.ones((4, 3)), np.eye(4)[:, :3])
    with pytest.raises(MapFileError, match=r"2 known points do not determine.*at least 3"):
        place_by_points(contents, np.eye(3)[:2], np.eye(3)[:2])


def test_a_straight_path_is_taken_and_told() -> None:
    contents = made_up_map()
    T_wc = contents.keyframes.T_wc.copy()
    T_wc[:, :3, 3] = np.outer(np.arange(8.0), [1.0, 2.0, 0.5])
    assert place_by_trajectory(contents, Trajectory(contents.keyframes.timestamps, T_wc)).on_a_line


@pytest.mark.filterwarnings("error")
def test_positions_that_cannot_be_meant() -> None:
    contents = made_up_map()
    far = np.eye(3)
    far[1] = [0, 1e300, 0]
    for places in ((np.eye(3), far), (far, np.eye(3)), (np.eye(3), np.full((3, 3), np.nan))):
        with pytest.raises(MapFileError, match=r"the position .*, .* cannot be meant; give"):
            place_by_points(contents, *places)
    truth = truth_of(contents, known(1.0))
    T_wc = truth.T_wc.copy()
    T_wc[3, 0, 3] = -1e300
    with pytest.raises(MapFileError, match=r"the position -1e\+300, "):
        place_by_trajectory(contents, Trajectory(truth.timestamps, T_wc))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("metres", [1e-9, 1e9])
def test_the_longest_and_the_shortest_length(metres: float) -> None:
    contents = made_up_map()
    ends = np.array([[0.0, 0, 0], [0, 3, 4]])
    moved = transform_map(contents, place_by_length(contents, *ends, metres).similarity)
    assert np.isfinite(moved.points.positions).all()
    assert (moved.points.max_distance > 0).all()


def test_a_known_length() -> None:
    contents = made_up_map()
    ends = contents.points.positions[[3, 17]]
    found = place_by_length(contents, ends[0], ends[1], 2.5)
    moved = transform_map(contents, found.similarity)
    assert np.linalg.norm(np.diff(moved.points.positions[[3, 17]], axis=0)) == pytest.approx(2.5)
    np.testing.assert_allclose(moved.keyframes.T_wc[0], contents.keyframes.T_wc[0], atol=1e-12)
    np.testing.assert_array_equal(found.similarity.R, np.eye(3))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("depth", "second", "metres", "words"),
    [
        (True, [1, 0, 0], 1.0, "has metres already"),
        (False, [1, 0, 0], 0.0, "the length is 0; give metres, above 0"),
        (False, [1, 0, 0], np.nan, "the length is nan; give metres"),
        (
            False,
            [1, 0, 0],
            1e300,
            r"a length of 1e\+300 m cannot be meant; give metres",
        ),
        (False, [1, 0, 0], 1e-300, "a length of 1e-300 m cannot be meant"),
        (False, [1e300, 0, 0], 1.0, r"the position 1e\+300, 0, 0 cannot be meant"),
        (False, [0, 0, 0], 1.0, "at one place"),
    ],
)
def test_lengths_that_tell_nothing(
    depth: bool, second: list[float], metres: float, words: str
) -> None:
    with pytest.raises(MapFileError, match=words):
        place_by_length(made_up_map(depth=depth), np.zeros(3), np.array(second, float), metres)
