# SPDX-License-Identifier: BSD-3-Clause
"""Maps moved into other worlds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbslam2py._arrays import FloatArray
from orbslam2py.maps import MapContents, transform_map
from orbslam2py.trajectory import Similarity
from support.made_up_map import LENS, made_up_map
from support.map_invariants import check_invariants

numbers = st.floats(-50, 50, allow_nan=False)
similarities = st.builds(
    lambda scale, turn, t: Similarity(scale, Rotation.from_rotvec(turn).as_matrix(), np.array(t)),
    st.floats(0.01, 100),
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.tuples(numbers, numbers, numbers),
)


def projected(contents: MapContents) -> tuple[FloatArray, FloatArray]:
    """Pixels and depths at which the observations' keyframes see their points."""
    keyframes, cameras, seen = contents.keyframes, contents.cameras, contents.observations
    T = keyframes.T_cw[np.searchsorted(keyframes.ids, seen.keyframe)]
    X = contents.points.positions[np.searchsorted(contents.points.ids, seen.point)]
    X = np.einsum("oij,oj->oi", T[:, :3, :3], X) + T[:, :3, 3]
    u = cameras.fx[0] * X[:, 0] / X[:, 2] + cameras.cx[0]
    v = cameras.fy[0] * X[:, 1] / X[:, 2] + cameras.cy[0]
    return np.column_stack([u, v]), X[:, 2]


@hypothesis_settings(deadline=None, max_examples=50)
@given(similarity=similarities, seed=st.integers(0, 20), depth=st.booleans())
def test_there_and_back(similarity: Similarity, seed: int, depth: bool) -> None:
    contents = made_up_map(5, 40, seed=seed, depth=depth, lens=LENS, colours=True)
    there = transform_map(contents, similarity)
    back = transform_map(there, similarity.inverse())
    for (name, new), (_, old) in zip(back.arrays(), contents.arrays(), strict=True):
        assert new.dtype == old.dtype, name
        if name == "keyframes.rotations":  # q and -q are one rotation
            new = new * np.sign(np.sum(new * old, axis=1))[:, None]  # noqa: PLW2901
        atol = 1e-9 * max(1.0, 100 / similarity.scale)
        np.testing.assert_allclose(new, old, rtol=1e-6, atol=atol, err_msg=name)


@hypothesis_settings(deadline=None, max_examples=50)
@given(similarity=similarities, seed=st.integers(0, 20))
def test_everything_is_seen_where_it_was(similarity: Similarity, seed: int) -> None:
    contents = made_up_map(5, 40, seed=seed, depth=True)
    moved = transform_map(contents, similarity)
    check_invariants(moved)
    (before, z_before), (after, z_after) = projected(contents), projected(moved)
    np.testing.assert_allclose(after, before, atol=1e-5)
    np.testing.assert_allclose(z_after, similarity.scale * z_before, rtol=1e-7)
    np.testing.assert_array_equal(moved.keyframes.keypoints, contents.keyframes.keypoints)
    # Depths still say how far the points are, and where the right camera sees them.
    depth = moved.keyframes.depth[moved.observed_keypoints]
    np.testing.assert_allclose(depth, z_after, rtol=1e-5)
    keypoints = moved.keyframes.keypoints[moved.observed_keypoints, 0]
    right = keypoints - moved.cameras.bf[0] / depth
    np.testing.assert_allclose(right, moved.keyframes.right_u[moved.observed_keypoints], atol=1e-3)


@hypothesis_settings(deadline=None, max_examples=30)
@given(similarity=similarities)
def test_directions_and_ranges_follow(similarity: Similarity) -> None:
    """What is kept about points is what the moved cameras give."""
    moved = transform_map(made_up_map(5, 40), similarity)
    keyframes, points = moved.keyframes, moved.points
    centres = keyframes.T_wc[:, :3, 3]
    for row, number in enumerate(points.ids.tolist()):
        seers, keypoints = moved.observations_of_point(number)
        rows = np.searchsorted(keyframes.ids, seers)
        rays = points.positions[row] - centres[rows]
        lengths = np.linalg.norm(rays, axis=1)
        mean = (rays / lengths[:, None]).mean(axis=0)
        np.testing.assert_allclose(points.mean_directions[row], mean, atol=1e-6)
        level = keyframes.octave[keyframes.offsets[rows[0]] + keypoints[0]]
        assert points.max_distance[row] == pytest.approx(lengths[0] * 1.2**level, rel=1e-6)


def test_unknown_depths_stay_unknown() -> None:
    contents = made_up_map(3, depth=True)
    moved = transform_map(contents, Similarity(3.0, np.eye(3), np.zeros(3)))
    unknown = contents.keyframes.depth <= 0
    assert unknown.any()
    assert np.all(moved.keyframes.depth[unknown] == -1)


def test_the_identity_changes_nothing() -> None:
    contents = made_up_map(4, depth=True)
    moved = transform_map(contents, Similarity.identity())
    for (name, new), (_, old) in zip(moved.arrays(), contents.arrays(), strict=True):
        np.testing.assert_allclose(new, old, atol=1e-15, err_msg=name)
