# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories read by the wrong convention, and right ones of which nothing must be said."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from orbslam2py import Trajectory
from orbslam2py.evaluation import OtherReading, evaluate_trajectory, find_other_reading
from orbslam2py.trajectory import QuaternionOrder, Reading
from support.made_up_paths import straight, wander

Poses = NDArray[np.float64]


def poses(turns: Poses, positions: Poses) -> Trajectory:
    T_wc = np.tile(np.eye(4), (len(turns), 1, 1))
    T_wc[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    T_wc[:, :3, 3] = positions
    return Trajectory(100 + 0.1 * np.arange(len(turns)), T_wc)


def handheld(n: int = 200) -> Trajectory:
    t = np.linspace(0, 20, n)
    turns = np.stack([0.3 * np.sin(t), 0.5 * np.sin(0.7 * t + 1), 0.2 * np.sin(1.3 * t)], 1)
    return poses(turns, np.stack([np.sin(0.5 * t), 0.5 * np.cos(0.8 * t), 0.3 * np.sin(t)], 1))


def car(n: int = 200) -> Trajectory:
    """A drive in the plane through some curves, looking ahead."""
    heading = 1.2 * np.sin(np.linspace(0, 9, n))
    turns = heading[:, None] * np.array([0, 1.0, 0])
    steps = Rotation.from_rotvec(turns).apply([0, 0, 1.0])
    return poses(turns, np.cumsum(steps, axis=0))


def circle(n: int = 100) -> Trajectory:
    """Around an object, looking at it."""
    turns = np.linspace(0, 5, n)[:, None] * np.array([0, 1.0, 0])
    return poses(turns, Rotation.from_rotvec(turns).apply([0, 0, -3.0]))


def estimated(
    truth: Trajectory, seed: int = 0, *, noise: float = 1e-3, body: bool = False, scale: float = 0.4
) -> Trajectory:
    """With noise and drift, in a world of its own and another unit; perhaps of another body."""
    random = np.random.default_rng(seed)
    n, size = len(truth), float(np.std(truth.positions))
    T = truth.T_wc.copy()
    T[:, :3, :3] = T[:, :3, :3] @ Rotation.from_rotvec(random.normal(0, noise, (n, 3))).as_matrix()
    T[:, :3, 3] += random.normal(0, 5 * noise * size + 1e-4, (n, 3))
    T[:, :3, 3] += np.cumsum(random.normal(0, noise * size, (n, 3)), axis=0)
    if body:
        T = T @ random_pose(random, 0.1)
    T = random_pose(random, 3.0) @ T
    T[:, :3, 3] *= scale
    return Trajectory(truth.timestamps, T)


def random_pose(random: np.random.Generator, size: float) -> Poses:
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=random).as_matrix()
    T[:3, 3] = random.normal(0, size, 3)
    return T


def w_first(path: Trajectory) -> Trajectory:
    """As it is read from a file of w x y z that is taken for x y z w."""
    T = path.T_wc.copy()
    x, y, z, w = path.quaternions.T
    T[:, :3, :3] = Rotation.from_quat(np.stack([w, x, y, z], axis=1)).as_matrix()
    return Trajectory(path.timestamps, T)


def inverse(path: Trajectory) -> Trajectory:
    return Trajectory(path.timestamps, path.T_cw)


def changes(found: OtherReading | None) -> tuple[bool, str, bool | None] | None:
    if found is None:
        return None
    return found.of_truth, str(found.quaternions or ""), found.inverse


# ---- wrong ones ----------------------------------------------------------------------------------
@pytest.mark.parametrize("body", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_wrong_conventions_are_seen(seed: int, body: bool) -> None:
    truth = handheld()
    estimate = estimated(truth, seed, body=body)
    for of_truth in (False, True):
        for wrong, quaternions, inverted in (
            (w_first, "wxyz", None),
            (inverse, "", True),
            (lambda path: w_first(inverse(path)), "wxyz", True),
        ):
            pair = (estimate, wrong(truth)) if of_truth else (wrong(estimate), truth)
            found = find_other_reading(*pair, "sim3")
            assert changes(found) == (of_truth, quaternions, inverted)


def test_figures_are_those_of_the_right_file() -> None:
    truth = handheld()
    estimate = estimated(truth)
    found = find_other_reading(inverse(estimate), truth, "sim3")
    assert found is not None
    assert found.otherwise.ate is not None
    assert found.as_read.ate is not None
    assert found.otherwise.ate.rmse < 0.03 < 0.3 < found.as_read.ate.rmse
    assert found.options == "give --inverse"
    ate = f"ATE {found.otherwise.ate.rmse:.3g} m instead of {found.as_read.ate.rmse:.3g} m"
    assert found.message.startswith(
        f"the poses of the estimate look like poses of the world in the camera: {ate}, RPE "
    )
    assert found.message.endswith("; give --inverse")


@pytest.mark.parametrize("scale", [0.4, 1.0, 2.5])
def test_figures_are_those_of_the_next_evaluation(scale: float) -> None:
    """The alignment is chosen anew for the right poses: they may be in another unit."""
    truth = handheld()
    estimate = estimated(truth, scale=scale)
    found = find_other_reading(inverse(estimate), truth)
    assert found is not None
    again = evaluate_trajectory(estimate, truth)
    assert found.otherwise.alignment is again.alignment
    assert found.otherwise.ate is not None
    assert again.ate is not None
    assert found.otherwise.ate.rmse == pytest.approx(again.ate.rmse)


@pytest.mark.parametrize("made", [car, circle, lambda: wander(150)])
def test_quaternions_of_paths_in_the_plane(made: object) -> None:
    truth = made()  # type: ignore[operator]
    found = find_other_reading(w_first(estimated(truth)), truth, "sim3")
    assert changes(found) == (False, "wxyz", None)
    assert found is not None
    assert "look like w first: RPE" in found.message
    assert found.message.endswith("; give --quaternions wxyz")


def test_files_that_were_read_as_told() -> None:
    """An option too many is seen as well, and what was told about the order is not doubted."""
    truth = handheld()
    estimate = estimated(truth)
    told = Reading(QuaternionOrder.WXYZ, order_is_known=False)
    x, y, z, w = estimate.quaternions.T
    T = estimate.T_wc.copy()
    T[:, :3, :3] = Rotation.from_quat(np.stack([y, z, w, x], axis=1)).as_matrix()
    wrong = Trajectory(estimate.timestamps, T)
    found = find_other_reading(wrong, truth, "sim3", estimate_reading=told)
    assert changes(found) == (False, "xyzw", None)
    sure = Reading(QuaternionOrder.WXYZ, order_is_known=True)
    no_file = Reading(is_file=False)
    assert (
        find_other_reading(*(wrong, truth, "sim3"), estimate_reading=sure, truth_reading=no_file)
        is None
    )
    inverted = Reading(QuaternionOrder.XYZW, inverse=True)
    found = find_other_reading(inverse(estimate), truth, "sim3", estimate_reading=inverted)
    assert changes(found) == (False, "", False)
    assert found is not None
    assert found.options == "leave out --inverse"


def test_true_poses_of_a_body() -> None:
    truth, T_body_camera = handheld(), random_pose(np.random.default_rng(5), 0.1)
    body = Trajectory(truth.timestamps, truth.T_wc @ np.linalg.inv(T_body_camera))
    read = Trajectory(truth.timestamps, w_first(body).T_wc @ T_body_camera)
    found = find_other_reading(estimated(truth), read, "sim3", T_body_camera=T_body_camera)
    assert changes(found) == (True, "wxyz", None)
    assert found is not None
    assert found.options == "give --truth-quaternions wxyz"
    assert found.otherwise.rpe_rotation is not None
    assert found.otherwise.rpe_rotation.rmse < 0.3


def test_either_of_both() -> None:
    """In one world, inverting the one does as well as inverting the other."""
    truth = handheld()
    found = find_other_reading(truth, inverse(truth), "se3")
    assert found is not None
    assert found.inverse
    assert found.either
    assert "(or it is the truth that is so)" in found.message


# ---- right ones ----------------------------------------------------------------------------------
RIGHT = {
    "handheld": handheld,
    "car": car,
    "circle": circle,
    "wander": lambda: wander(60),
    "line": lambda: straight(50, 0.2),
    "short": lambda: wander(12),
    "very short": lambda: wander(4),
    "curve": lambda: car().select(slice(0, 15)),
    "stands still": lambda: poses(np.zeros((30, 3)), np.zeros((30, 3))),
    "spins": lambda: poses(np.linspace(0, 5, 60)[:, None] * [0, 1.0, 0], np.zeros((60, 3))),
}


@pytest.mark.parametrize("body", [False, True])
@pytest.mark.parametrize("noise", [1e-4, 3e-3, 3e-2])
@pytest.mark.parametrize("name", RIGHT)
def test_nothing_is_said_of_right_ones(name: str, noise: float, body: bool) -> None:
    truth = RIGHT[name]()
    for seed in range(4):
        estimate = estimated(truth, seed, noise=noise, body=body)
        for alignment in ("se3", "sim3"):
            assert find_other_reading(estimate, truth, alignment) is None


@pytest.mark.parametrize("without", ["truth", "estimate"])
def test_nothing_is_said_of_positions_alone(without: str) -> None:
    """GPS has no rotations: its files hold a constant one."""
    truth = handheld()
    estimate = estimated(truth)
    still = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
    for T in [truth.T_wc.copy() if without == "truth" else estimate.T_wc.copy()]:
        T[:, :3, :3] = still
        pair = (
            (estimate, Trajectory(truth.timestamps, T))
            if without == "truth"
            else (Trajectory(truth.timestamps, T), truth)
        )
        assert find_other_reading(*pair, "sim3") is None


def test_nothing_is_said_of_what_has_nothing_in_common() -> None:
    for seed in range(20):
        pair = wander(80, seed), wander(80, seed + 100)
        assert find_other_reading(*pair, "sim3") is None
