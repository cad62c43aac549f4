# SPDX-License-Identifier: BSD-3-Clause
"""The container of poses with time stamps."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py.trajectory import Trajectory
from support.made_up_paths import made_up


def test_fields_are_filled_in_and_checked() -> None:
    trajectory = made_up(3)
    np.testing.assert_array_equal(trajectory.lost, [False] * 3)
    np.testing.assert_array_equal(trajectory.indices, [0, 1, 2])
    assert len(trajectory.select(np.array([True, False, True]))) == 2
    with pytest.raises(ValueError, match="3 timestamps, but 2 T_wc"):
        Trajectory(np.arange(3), trajectory.T_wc[:2])
