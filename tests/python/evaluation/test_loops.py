# SPDX-License-Identifier: BSD-3-Clause
"""Judging loops, on paths made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py.errors import DatasetError
from orbslam2py.evaluation import (
    LoopError,
    Revisit,
    closed_revisits,
    find_revisits,
    loop_error,
    metres_per_unit_at,
)
from orbslam2py.trajectory import Trajectory


def pose(position: list[float], degrees: float = 0.0) -> np.ndarray:
    """Turned about the y axis."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    T[:3, 3] = position
    return T


def along_z(metres: np.ndarray, degrees: np.ndarray | float = 0.0) -> Trajectory:
    """A pose every tenth of a second."""
    turns = np.broadcast_to(degrees, len(metres))
    T_wc = [pose([0, 0, z], float(turn)) for z, turn in zip(metres, turns, strict=True)]
    return Trajectory(0.1 * np.arange(len(metres)), np.array(T_wc))


def circle(n: int, turns: float) -> Trajectory:
    """Around a circle of 62.8 m, looking ahead; n poses a turn, one every tenth of a second."""
    angles = np.arange(int(turns * n)) * 2 * math.pi / n
    T_wc = [
        pose([10 * (1 - math.cos(a)), 0, 10 * math.sin(a)], float(np.degrees(a))) for a in angles
    ]
    return Trajectory(0.1 * np.arange(len(angles)), np.array(T_wc))


# ---- one loop ------------------------------------------------------------------------------------
T_WM, T_WC = pose([0, 0, 0], 10), pose([0.4, 0, 3], 25)
S_CM = np.linalg.inv(T_WC) @ T_WM


def test_a_loop_that_says_the_truth() -> None:
    error = loop_error(S_CM, T_WC, T_WM)
    assert error.distance_m == pytest.approx(math.hypot(0.4, 3))
    assert error.translation_m < 1e-12
    assert error.rotation_deg < 1e-6
    assert error.is_true


def test_scale_and_unit_of_a_single_camera() -> None:
    """The map's unit is worth 4 m at the matched camera, and has shrunk by 0.9 since."""
    S_cm = S_CM.copy()
    S_cm[:3, :3] *= 0.9
    S_cm[:3, 3] *= 0.9 / 4
    error = loop_error(S_cm, T_WC, T_WM, metres_per_unit=4.0)
    assert error.translation_m < 1e-12
    assert error.rotation_deg < 1e-6


def test_a_loop_that_is_off() -> None:
    claimed_T_wc = T_WC.copy()
    claimed_T_wc[:3, 3] += [0.3, 0, 0.4]
    error = loop_error(np.linalg.inv(claimed_T_wc) @ T_WM, T_WC, T_WM)
    assert error.translation_m == pytest.approx(0.5)
    assert not error.is_true
    turned = loop_error(np.linalg.inv(T_WC @ pose([0, 0, 0], 12)) @ T_WM, T_WC, T_WM)
    assert turned.translation_m < 1e-12
    assert turned.rotation_deg == pytest.approx(12)
    assert not turned.is_true


def test_tolerance_grows_with_the_distance() -> None:
    assert not LoopError(distance_m=1.0, translation_m=0.35, rotation_deg=0).is_true
    assert LoopError(distance_m=5.0, translation_m=0.35, rotation_deg=0).is_true


# ---- units of a single camera --------------------------------------------------------------------
def test_scale_is_that_of_the_place() -> None:
    """Estimated steps are half the true ones, and a quarter from the middle on."""
    truth = along_z(0.1 * np.arange(200))
    steps = np.where(np.arange(199) < 100, 0.05, 0.025)
    estimate = along_z(np.concatenate([[0.0], np.cumsum(steps)]))
    assert metres_per_unit_at(2.0, estimate, truth, 2.0) == pytest.approx(2)
    assert metres_per_unit_at(17.0, estimate, truth, 2.0) == pytest.approx(4)
    both = metres_per_unit_at(10.0, estimate, truth, 2.0)
    assert 2 < both < 4


def test_the_scale_goes_by_time_and_not_by_rows() -> None:
    truth = along_z(0.1 * np.arange(200))
    steps = np.where(np.arange(199) < 100, 0.05, 0.025)
    estimate = along_z(np.concatenate([[0.0], np.cumsum(steps)]))
    order = np.random.default_rng(0).permutation(200)
    for mixed in ((estimate.select(order), truth), (estimate, truth.select(order))):
        assert metres_per_unit_at(2.0, *mixed, 2.0) == pytest.approx(2)
        assert metres_per_unit_at(17.0, *mixed, 2.0) == pytest.approx(4)


def test_lost_poses_are_left_out() -> None:
    truth = along_z(0.1 * np.arange(50))
    lost = np.arange(50) % 2 == 1
    positions = np.where(lost, 99.0, 0.05 * np.arange(50))
    estimate = along_z(positions)
    estimate = Trajectory(estimate.timestamps, estimate.T_wc, lost)
    assert metres_per_unit_at(2.5, estimate, truth, 1.0) == pytest.approx(2)


def test_too_few_poses_show_no_scale() -> None:
    truth = along_z(0.1 * np.arange(50))
    with pytest.raises(DatasetError, match=r"fewer than three poses within 0\.05 m .* 2\.500 s"):
        metres_per_unit_at(2.5, truth, truth, 0.05)
    later = Trajectory(truth.timestamps + 100, truth.T_wc)
    with pytest.raises(DatasetError, match="no time stamps"):
        metres_per_unit_at(2.5, later, truth, 1.0)


# ---- places seen again ---------------------------------------------------------------------------
def test_a_second_lap_is_one_revisit() -> None:
    [revisit] = find_revisits(circle(400, 1.5), near=1.0, apart=10.0)
    # A metre before the lap is full the start is near; from then on every place is known.
    assert revisit.begin == pytest.approx(40.0, abs=0.7)
    assert revisit.begin < 40.0
    assert revisit.end == pytest.approx(59.9)


def test_revisits_go_by_time_and_not_by_rows() -> None:
    truth = circle(400, 1.5)
    order = np.random.default_rng(0).permutation(len(truth))
    found = find_revisits(truth.select(order), near=1.0, apart=10.0)
    assert found == find_revisits(truth, near=1.0, apart=10.0)


def test_the_way_back_looks_the_other_way() -> None:
    out = 0.1 * np.arange(300)
    metres, turns = np.concatenate([out, out[::-1]]), np.repeat([0.0, 180.0], 300)
    assert find_revisits(along_z(metres, turns), near=1.0, apart=10.0) == []
    backwards = find_revisits(along_z(metres), near=1.0, apart=10.0)
    assert len(backwards) == 1


def test_gaps_of_a_revisit_and_two_revisits() -> None:
    """Beside the first way for a short and then for a long stretch of the second."""
    first = 0.1 * np.arange(1000)
    aside = np.zeros(2000)
    aside[1200:1230] = 5.0  # 3 m of 100
    aside[1500:1800] = 5.0  # 30 m
    T_wc = np.array(
        [pose([x, 0, z]) for x, z in zip(aside, np.concatenate([first, first]), strict=True)]
    )
    truth = Trajectory(0.1 * np.arange(2000), T_wc)
    # The jump back to the start is 100 m of path as well.
    revisits = find_revisits(truth, near=1.0, apart=15.0)
    assert revisits == [Revisit(100.0, pytest.approx(149.9)), Revisit(180.0, pytest.approx(199.9))]


def test_a_straight_way_and_none() -> None:
    assert find_revisits(along_z(0.1 * np.arange(500)), near=1.0, apart=10.0) == []
    assert find_revisits(along_z(np.zeros(0)), near=1.0, apart=10.0) == []


def test_loops_belong_to_the_nearest_revisit() -> None:
    revisits = [Revisit(10, 20), Revisit(40, 50)]
    assert revisits[0].seconds_from(8) == 2
    assert revisits[0].seconds_from(15) == 0
    assert revisits[0].seconds_from(23) == 3
    assert closed_revisits(revisits, np.array([])).tolist() == [False, False]
    assert closed_revisits(revisits, np.array([12.0, 25.0])).tolist() == [True, False]
    assert closed_revisits(revisits, np.array([36.0])).tolist() == [False, True]
    assert closed_revisits([], np.array([36.0])).tolist() == []
