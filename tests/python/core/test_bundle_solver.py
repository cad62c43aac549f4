# SPDX-License-Identifier: BSD-3-Clause
"""The solvers of a bundle adjustment from Python: one minimum, one set of bytes."""

import numpy as np
import pytest

from orbslam2py import _core as core

FOCAL = 500.0


def _window() -> tuple[object, ...]:
    """Arguments of `solve_bundle`: six cameras in a row, two of them fixed, before 80 points."""
    random = np.random.default_rng(3)
    true_points = random.uniform([-1, -1, 4], [3, 1, 9], (80, 3))
    shifts = [np.array([-0.3 * k, 0.0, 0.0]) for k in range(6)]
    camera, point = np.divmod(np.arange(6 * 80), 80)
    seen = true_points[point] + np.array(shifts)[camera]
    pixels = np.full((len(seen), 3), np.nan)
    pixels[:, :2] = FOCAL * seen[:, :2] / seen[:, 2:] + (320, 240)
    pixels[:, :2] += random.uniform(-0.5, 0.5, (len(seen), 2))
    pixels[::31, 0] += 40
    poses = []
    for k, shift in enumerate(shifts):
        disturbed = random.uniform(-0.005, 0.005, 6) if k >= 2 else np.zeros(6)
        matrix = np.eye(4)
        matrix[:3, 3] = shift
        poses.append(core.Pose.exp(disturbed) @ core.Pose.from_matrix(matrix))
    points = true_points + random.uniform(-0.05, 0.05, true_points.shape)
    fixed = [k < 2 for k in range(6)]
    options = core.CameraOptions(
        fx=FOCAL, fy=FOCAL, cx=320, cy=240, width=640, height=480, bf=40.0, depth_ratio=40.0
    )
    return poses, fixed, core.Camera(options), points, camera, point, pixels, np.ones(len(seen))


def test_both_solvers_find_one_minimum_and_the_same_outliers() -> None:
    window = _window()
    _, by_blocks, blocks = core.solve_bundle(*window, core.BundleOptions(solver="blocks"))
    _, by_ceres, ceres = core.solve_bundle(*window, core.BundleOptions(solver="ceres"))
    assert blocks.final_cost == pytest.approx(ceres.final_cost, rel=1e-6)
    np.testing.assert_array_equal(blocks.outlier, ceres.outlier)
    assert blocks.outlier[::31].all()
    np.testing.assert_allclose(by_blocks, by_ceres, atol=1e-3)


def test_threads_do_not_change_a_byte() -> None:
    window = _window()
    one = core.solve_bundle(*window, core.BundleOptions(solver="blocks", n_threads=1))
    two = core.solve_bundle(*window, core.BundleOptions(solver="blocks", n_threads=2))
    np.testing.assert_array_equal(one[1], two[1])
    for T_one, T_two in zip(one[0], two[0], strict=True):
        np.testing.assert_array_equal(T_one.matrix, T_two.matrix)


def test_local_adjustment_is_by_blocks_unless_ceres_is_named() -> None:
    assert core.BundleOptions().solver == "blocks"
    options = core.BundleOptions()
    options.solver = "ceres"
    assert options.solver == "ceres"


def test_an_unknown_solver_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'blocks' or 'ceres', not 'g2o'"):
        core.BundleOptions(solver="g2o")
    with pytest.raises(ValueError, match=r"'blocks' or 'ceres', not ''"):
        core.local_bundle_adjustment(core.Map(), 0, solver="")


def test_inverse_depths_are_for_ceres() -> None:
    options = core.BundleOptions(solver="blocks", inverse_depth=True)
    with pytest.raises(core.StateError, match="Ceres"):
        core.solve_bundle(*_window(), options)
