# SPDX-License-Identifier: BSD-3-Clause
"""Drift over a lap, against paths computed by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py import DatasetError, Trajectory
from orbslam2py.evaluation import lap_error, scale_drift


def circle(n: int, radius: float = 10.0, turns: float = 1.2) -> Trajectory:
    """Along a circle about the y axis, looking ahead; the first of `turns` has n poses."""
    angles = np.arange(int(turns * n)) * 2 * math.pi / n
    T_wc = np.tile(np.eye(4), (len(angles), 1, 1))
    T_wc[:, :3, :3] = Rotation.from_rotvec(angles[:, None] * np.array([[0.0, 1, 0]])).as_matrix()
    T_wc[:, :3, 3] = radius * np.stack(
        [1 - np.cos(angles), np.zeros(len(angles)), np.sin(angles)], axis=1
    )
    return Trajectory(np.arange(len(angles)) * 0.1, T_wc)


def test_error_of_a_lap_that_does_not_close() -> None:
    """The estimate drifts upwards by 1 mm per pose and turns by 0.01 degrees per pose."""
    truth = circle(400)
    T_wc = truth.T_wc.copy()
    T_wc[:, 1, 3] -= 0.001 * np.arange(len(truth))
    turned = Rotation.from_rotvec(np.radians(0.01) * np.arange(len(truth))[:, None] * [[1.0, 0, 0]])
    T_wc[:, :3, :3] = T_wc[:, :3, :3] @ turned.as_matrix()
    world = np.eye(4)
    world[:3, :3] = Rotation.from_rotvec([1, 2, 3]).as_matrix()
    estimate = Trajectory(truth.timestamps, world @ T_wc)
    chord = 20 * math.sin(math.pi / 400)
    error = lap_error(estimate, truth, 400 * chord - 1e-6)
    assert error.translation_m == pytest.approx(0.4)
    assert error.rotation_deg == pytest.approx(4.0)
    assert error.path_m == pytest.approx(400 * chord)
    assert error.percent == pytest.approx(100 * 0.4 / (400 * chord))
    whole = lap_error(estimate, truth)
    assert whole.translation_m == pytest.approx(0.479)
    assert whole.path_m == pytest.approx(479 * chord)


def test_error_of_a_lap_starts_with_the_first_pose_and_spans_gaps() -> None:
    truth = circle(400)
    kept = np.r_[50:200, 300:451]
    error = lap_error(truth.select(kept), truth, 62.8)
    assert error.translation_m < 1e-12
    assert error.path_m == pytest.approx(400 * 20 * math.sin(math.pi / 400))


def test_error_of_a_lap_of_one_camera_is_taken_in_true_metres() -> None:
    truth = circle(400)
    T_wc = truth.T_wc.copy()
    T_wc[:, :3, 3] *= 0.2
    T_wc[-1, 1, 3] += 0.2 * 0.3
    estimate = Trajectory(truth.timestamps, T_wc)
    assert lap_error(estimate, truth, with_scale=True).translation_m == pytest.approx(0.3, rel=0.01)


@pytest.mark.parametrize("unit", [1.0, 0.3])
def test_scale_that_grows_by_three_percent_over_a_lap(unit: float) -> None:
    """Every step is drawn larger than the one before."""
    truth = circle(1000)
    n = len(truth)
    growth = 1.03 ** (np.arange(n) / 1000)
    steps = np.diff(truth.positions, axis=0) * growth[1:, None]
    T_wc = truth.T_wc.copy()
    T_wc[:, :3, 3] = unit * np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    estimate = Trajectory(truth.timestamps, T_wc)
    # From the middle of the first tenth to the middle of the last: 0.9 laps.
    expected = 1.03**0.9 - 1
    assert scale_drift(estimate, truth, 62.8) == pytest.approx(expected, rel=0.01)
    narrow = scale_drift(estimate, truth, 62.8, window=1.0)
    assert narrow == pytest.approx(1.03 ** (1 - 1 / 62.8) - 1, rel=0.01)
    assert scale_drift(truth, truth) == pytest.approx(0, abs=1e-12)


def test_files_in_another_order_than_that_of_time() -> None:
    """As those that several tools have written one after the other."""
    truth = circle(400)
    T_wc = truth.T_wc.copy()
    T_wc[:, :3, 3] *= 1 + 1e-4 * np.arange(len(truth))[:, None]
    estimate = Trajectory(truth.timestamps, T_wc)
    order = np.random.default_rng(0).permutation(len(truth))
    for mixed in ((estimate.select(order), truth), (estimate, truth.select(order))):
        assert lap_error(*mixed, 40.0) == lap_error(estimate, truth, 40.0)
        assert scale_drift(*mixed) == pytest.approx(scale_drift(estimate, truth))


def test_laps_that_cannot_be_judged() -> None:
    truth = circle(400)
    with pytest.raises(DatasetError, match=r"ends after 31\.\d+ m of a lap of 60\.00 m"):
        lap_error(truth.select(np.arange(200)), truth, 60.0)
    with pytest.raises(DatasetError, match="fewer than three"):
        scale_drift(truth, truth, window=0.01)
    still = Trajectory(truth.timestamps, np.tile(np.eye(4), (len(truth), 1, 1)))
    with pytest.raises(DatasetError, match="did not move"):
        lap_error(truth, still)
