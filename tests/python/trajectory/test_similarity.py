# SPDX-License-Identifier: BSD-3-Clause
"""Similarities are those, or are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py import DatasetError
from orbslam2py.trajectory import Similarity

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
