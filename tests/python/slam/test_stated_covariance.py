# SPDX-License-Identifier: BSD-3-Clause
"""The covariance that is stated with a pose, against the truth and with the core replaced."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from orbslam2py import Sensor, System
from orbslam2py.slam.config import AcceptanceConfig
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.rotations import inverse_poses
from support.tracking_scene import Scene

Floats = NDArray[np.float64]
LIMITS = AcceptanceConfig()
N = 60


# ---- against the truth ---------------------------------------------------------------------------
def motions_of(sensor: Sensor, world: str, seed: int, **config: object) -> tuple[Floats, Floats]:
    """Errors (m, 6) of the motions from frame to frame of a run, and their covariances."""
    options = SyntheticOptions(
        world=world, sensor=sensor, size=(320, 240), frames=N, noise=2, seed=seed
    )
    sequence = SyntheticSequence(options)
    poses, covariances = [], []
    with System(sequence.settings, sensor, deterministic=True, config=config) as slam:
        for index in range(N):
            record = slam.track(sequence.load(index), index / 20)
            assert record.T_cw is not None
            poses.append(record.T_cw)
            covariances.append(record.covariance)
    errors, stated = [], []
    T_cw = np.array([inverse_poses(sequence.T_wc(index)[None])[0] for index in range(N)])
    for k in range(6, N):
        motion = poses[k] @ np.linalg.inv(poses[k - 1])
        true = T_cw[k] @ np.linalg.inv(T_cw[k - 1])
        errors.append(tangent(true @ np.linalg.inv(motion)))
        # Between two frames it is the rotation that matters: both axes are nearly the same.
        stated.append(covariances[k] + covariances[k - 1])
    return np.array(errors), np.array(stated)


def tangent(T: Floats) -> Floats:
    """Rotation [rad] and translation [m] of a small motion."""
    R = T[:3, :3]
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], *(2 * T[:3, 3])]) / 2


@pytest.mark.parametrize(("sensor", "world"), [(Sensor.STEREO, "corridor"), (Sensor.RGBD, "room")])
def test_errors_are_as_large_as_stated(sensor: Sensor, world: str) -> None:
    """Their mean normalised square is near that of chi-square; that of pixel noise is larger."""
    mean = normalised_squares(*motions_of(sensor, world, 0)).mean()
    classical = {"acceptance.robust_covariance": False}
    of_pixel_noise = normalised_squares(*motions_of(sensor, world, 0, **classical)).mean()
    assert 0.3 < mean / 6 < 1.3
    assert of_pixel_noise > mean


def normalised_squares(errors: Floats, stated: Floats) -> Floats:
    return np.einsum("mi,mij,mj->m", errors, np.linalg.inv(stated), errors)


# ---- what residuals cannot show ------------------------------------------------------------------
def test_it_is_that_of_the_clusters(careful: Scene) -> None:
    usual = careful.track().estimate.covariance
    careful.core.covariance = 2.5 * careful.core.covariance
    larger = careful.track().estimate.covariance
    assert usual is not None
    np.testing.assert_allclose(larger, 2.5 * usual)


@pytest.mark.parametrize(("error", "factor"), [(0.7, 1.0), (1.6, 4.0)])
def test_it_grows_with_the_error_of_all_matches(
    careful: Scene, error: float, factor: float
) -> None:
    usual = careful.track().estimate.covariance
    careful.core.match_error = error
    larger = careful.track().estimate.covariance
    assert usual is not None
    np.testing.assert_allclose(larger, factor * usual)


def test_the_motion_of_map_and_camera_is_part_of_it(careful: Scene) -> None:
    careful.track()
    careful.map.keyframe_x += 0.5
    careful.track()
    velocity, map_motion, share = careful.core.stated[-1]
    assert share == LIMITS.wrong_share
    np.testing.assert_allclose(velocity.step.translation, 0)
    np.testing.assert_allclose(map_motion.translation, [0.5, 0, 0])
    careful.track()
    velocity, map_motion, _ = careful.core.stated[-1]
    np.testing.assert_allclose(map_motion.translation, 0, err_msg="since the last frame alone")


def test_a_loop_that_moved_the_map_says_nothing_of_now(careful: Scene) -> None:
    careful.track()
    careful.map.keyframe_x += 0.5
    careful.map.big_change_index += 1
    careful.track()
    assert careful.core.stated[-1][1] is None
