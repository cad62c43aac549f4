# SPDX-License-Identifier: BSD-3-Clause
"""Covariances of poses, as Python hands them over and gets them back."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core as core


def test_a_covariance_is_widened_by_a_factor_and_by_errors() -> None:
    covariance = np.diag([1.0, 2, 3, 4, 5, 6])
    error = np.array([0.0, 1, 0, 0, -2, 0])
    expected = 2 * covariance + np.outer(error, error) + np.eye(6)[5][:, None] * np.eye(6)[5]
    widened = core.widened_covariance(covariance, 2.0, [error, np.eye(6)[5]])
    np.testing.assert_array_equal(widened, expected)
    np.testing.assert_array_equal(core.widened_covariance(covariance, 1.0, []), covariance)
    np.testing.assert_array_equal(covariance, np.diag([1.0, 2, 3, 4, 5, 6]))


def test_a_positions_deviation_is_that_of_all_directions() -> None:
    covariance = np.diag([9.0, 9, 9, 4, 4, 1])
    assert core.position_deviation(covariance) == 3
    # In any memory order, and as a part of a larger array.
    several = np.stack([np.eye(6), covariance])
    assert core.position_deviation(several[1].T) == 3
    assert core.position_deviation(-covariance) == 0


@pytest.mark.parametrize("shape", [(5, 6), (6,), (6, 6, 1)])
def test_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(TypeError):
        core.position_deviation(np.zeros(shape))
    with pytest.raises(TypeError):
        core.widened_covariance(np.zeros(shape), 1.0, [])
