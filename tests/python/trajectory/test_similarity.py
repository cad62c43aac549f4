# SPDX-License-Identifier: BSD-3-Clause
"""Similarities are those, or are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py import DatasetError
from orbslam2py.trajectory import Similarity, align
from orbslam2py.trajectory.rotations import rotation_angles

TURN = Rotation.from_rotvec([0.3, -1.0, 0.2]).as_matrix()
NOWHERE = np.zeros(3)


@pytest.mark.parametrize(
    ("scale", "R", "t", "words"),
    [
        (0, np.eye(3), NOWHERE, "the scale of the similarity is 0; give a number above 0"),
        (-1, np.eye(3), NOWHERE, "the scale of the similarity is -1"),
        (np.nan, np.eye(3), NOWHERE, "the scale of the similarity is nan"),
        (np.inf, np.eye(3), NOWHERE, "the scale of the similarity is inf"),
        ("1", np.eye(3), NOWHERE, "the scale of the similarity is '1'"),
        (1, np.ones((3, 3)), NOWHERE, "R of the similarity is no rotation; give"),
        (1, np.diag([1.0, 1.0, -1.0]), NOWHERE, "R of the similarity is no rotation"),
        (1, 1.001 * np.eye(3), NOWHERE, "R of the similarity is no rotation"),
        (1, 1e200 * np.eye(3), NOWHERE, "R of the similarity is no rotation"),
        (1, np.full((3, 3), np.nan), NOWHERE, "R of the similarity is no rotation"),
        (1, np.eye(4), NOWHERE, r"the rotation R of the similarity has shape \(4, 4\)"),
        (1, np.eye(3), np.full(3, np.nan), "the translation t .* is not finite; give 3 numbers"),
        (1, np.eye(3), np.zeros(2), r"the translation t of the similarity has shape \(2,\)"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_is_no_similarity_is_refused(scale: Any, R: Any, t: Any, words: str) -> None:
    with pytest.raises(DatasetError, match=words):
        Similarity(scale, R, t)


@pytest.mark.parametrize("R", [TURN.round(4), TURN.astype(np.float32), TURN.round(6).tolist()])
def test_a_rounded_rotation_is_made_orthonormal(R: Any) -> None:
    made = Similarity(2, R, [1, 2, 3]).R  # type: ignore[arg-type]
    np.testing.assert_allclose(made @ made.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(made, TURN, atol=1e-4)


def test_an_exact_rotation_stays_as_it_is() -> None:
    np.testing.assert_array_equal(Similarity(1.0, TURN, NOWHERE).R, TURN)


# ---- straight lines ------------------------------------------------------------------------------
DIRECTIONS = [[1, 2, 3], [0, 0, 1], [-1, 0.2, 0.1], [1e-3, 1, 0]]


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_a_straight_line_is_not_turned_around_itself(direction: Any, scale: float) -> None:
    line = np.outer(np.linspace(0, 10, 50), direction)
    found = align(line, scale * line + [4, 5, 6], with_scale=True)
    np.testing.assert_allclose(found.R, np.eye(3), atol=1e-7)
    assert found.scale == pytest.approx(scale)
    np.testing.assert_allclose(found.t, [4, 5, 6], atol=1e-5)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_turn_of_a_line_is_the_smallest_one(direction: Any) -> None:
    line = np.outer(np.linspace(0, 10, 50), direction)
    turned = line @ TURN.T
    found = align(line, turned)
    np.testing.assert_allclose(found.apply(line), turned, atol=1e-9)
    between = np.arccos(np.clip((line[1] @ turned[1]) / (line[1] @ line[1]), -1, 1))
    assert rotation_angles(found.R[None])[0] == pytest.approx(between, abs=1e-6)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_line_that_runs_the_other_way_is_turned_by_half_a_turn(direction: Any) -> None:
    line = np.outer(np.linspace(0, 10, 50), direction)
    found = align(line, -line)
    np.testing.assert_allclose(found.apply(line), -line, atol=1e-9)
    assert np.linalg.det(found.R) == pytest.approx(1)


def test_what_is_taken_for_a_line_is_not_turned_around_it() -> None:
    rng = np.random.default_rng(0)
    line = np.outer(np.linspace(0, 10, 50), [1.0, 0, 0])
    first, second = (line + 1e-3 * rng.standard_normal(line.shape) for _ in range(2))
    freely, as_line = (align(first, second, on_a_line=taken) for taken in (None, True))
    assert rotation_angles(freely.R[None])[0] > 0.1
    assert rotation_angles(as_line.R[None])[0] < 1e-3
