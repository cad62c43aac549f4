# SPDX-License-Identifier: BSD-3-Clause
"""Points of a moving camera tell the calibration, if the camera turns."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.data_misfit import find_data_misfit
from orbslam2py.calibration.self_calibration import CalibrationGains, calibration_gains
from orbslam2py.calibration.two_views import PointPair, without_gross_errors
from orbslam2py.settings import CameraSettings, FitThresholds, Misfit

CAMERA = CameraSettings(500, 500, 320, 240)
NOISE = 0.2


def made_pairs(
    camera: CameraSettings, *, turn: float, depths: bool, forward: bool = False, seed: int = 3
) -> list[PointPair]:
    """Eight pairs of images of a cloud of points: `turn` is the largest angle [degrees]."""
    random = np.random.default_rng(seed)
    pairs = []
    for number in range(8):
        pixels = random.uniform((10, 10), (630, 470), (120, 2))
        z = random.uniform(2, 6, 120)
        rays = cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion)[:, 0]
        points = np.column_stack([rays * z[:, None], z])
        axis = random.normal(size=3) * (1, 1, 0.3)
        angle = np.radians(turn) * (number + 1) / 8
        R = cv2.Rodrigues(angle * axis / np.linalg.norm(axis))[0]
        t = np.array([0, 0, -0.3]) if forward else random.normal(0, 0.25, 3)
        seen = cv2.projectPoints(points @ R.T + t, np.zeros(3), np.zeros(3), camera.matrix,
                                 camera.distortion)[0][:, 0]  # fmt: skip
        noise = random.normal(0, NOISE, (2, 120, 2))
        pairs.append(PointPair(pixels + noise[0], seen + noise[1], 7.5 * z if depths else None))
    return pairs


def judged(
    camera: CameraSettings, pairs: list[PointPair], gains: CalibrationGains | None = None
) -> Misfit | None:
    gains = gains or calibration_gains(camera, pairs)
    return find_data_misfit(camera, pairs, gains, FitThresholds())


def with_focal(factor: float) -> CameraSettings:
    return replace(CAMERA, fx=factor * CAMERA.fx, fy=factor * CAMERA.fy)


DISTORTED = replace(CAMERA, k1=-0.2, k2=0.05)


@pytest.mark.parametrize(  # all pairs of two
    ("depths", "turn", "camera"),
    [(False, 0.0, CAMERA), (False, 20.0, DISTORTED), (True, 0.0, DISTORTED), (True, 20.0, CAMERA)],
)
def test_the_right_calibration_is_not_told(
    depths: bool, turn: float, camera: CameraSettings
) -> None:
    pairs = made_pairs(camera, turn=turn, depths=depths)
    gains = calibration_gains(camera, pairs)
    assert gains is not None
    assert gains.residual < 3 * NOISE
    assert max(gains.focal.gain, gains.centre.gain, gains.radial.gain) < 1.1
    assert judged(camera, pairs, gains) is None


@pytest.mark.parametrize(
    ("depths", "factor"),
    [(True, 0.6), (True, 0.75), (True, 1.7), (False, 0.6), (False, 1.35)],
)
def test_a_turning_camera_tells_its_focal_length(depths: bool, factor: float) -> None:
    pairs, wrong = made_pairs(CAMERA, turn=20, depths=depths), with_focal(factor)
    gains = calibration_gains(wrong, pairs)
    assert gains is not None
    assert wrong.fx * np.exp(gains.focal.values[0]) == pytest.approx(CAMERA.fx, rel=0.03)
    misfit = judged(wrong, pairs, gains)
    assert misfit is not None
    assert f"not {wrong.fx:.0f}" in misfit.seen
    assert "focal length" in misfit.cause


@pytest.mark.parametrize(("depths", "factor"), [(False, 0.6), (True, 1.7)])
def test_a_camera_that_only_moves_on_cannot_know(depths: bool, factor: float) -> None:
    pairs = made_pairs(CAMERA, turn=0, depths=depths, forward=True)
    assert judged(with_focal(factor), pairs) is None


def test_a_wrong_principal_point_is_told_with_depths() -> None:
    pairs = made_pairs(CAMERA, turn=20, depths=True)
    misfit = judged(replace(CAMERA, cx=CAMERA.cx + 90), pairs)
    assert misfit is not None
    assert "principal point" in misfit.seen
    assert "not (410, 240)" in misfit.seen


@pytest.mark.parametrize("depths", [False, True])
def test_a_missing_distortion_is_told(depths: bool) -> None:
    pairs = made_pairs(replace(CAMERA, k1=-0.28, k2=0.07), turn=15, depths=depths)
    misfit = judged(CAMERA, pairs)
    assert misfit is not None
    assert "settings that say it does not" in misfit.cause


@pytest.mark.parametrize("depths", [False, True])
def test_a_distortion_too_much_is_told(depths: bool) -> None:
    pairs = made_pairs(CAMERA, turn=15, depths=depths)
    misfit = judged(replace(CAMERA, k1=-0.28, k2=0.07), pairs)
    assert misfit is not None
    assert "undistorted already" in misfit.cause


def test_noise_alone_is_not_told() -> None:
    """A blurred run has large residuals with every calibration."""
    random = np.random.default_rng(4)
    pairs = [
        replace(pair, second=pair.second + random.normal(0, 3, pair.second.shape))
        for pair in made_pairs(CAMERA, turn=15, depths=True)
    ]
    assert judged(CAMERA, pairs) is None


def test_few_pairs_and_points_say_nothing() -> None:
    pairs = made_pairs(CAMERA, turn=20, depths=True)
    wrong = with_focal(0.6)
    assert judged(wrong, pairs[:3]) is None
    assert calibration_gains(wrong, [PointPair(p.first[:50], p.second[:50]) for p in pairs]) is None
    unknown = [replace(p, depths=np.zeros(len(p.first))) for p in pairs]
    assert calibration_gains(wrong, unknown) is None


def test_gross_errors_are_left_out() -> None:
    pair = made_pairs(CAMERA, turn=10, depths=False)[7]
    spoilt: FloatArray = pair.second.copy()
    spoilt[:30] = np.random.default_rng(5).uniform(0, 480, (30, 2))
    kept = without_gross_errors(replace(pair, second=spoilt))
    assert kept is not None
    assert 80 < len(kept.first) < 100
    assert without_gross_errors(PointPair(pair.first[:5], pair.second[:5])) is None
