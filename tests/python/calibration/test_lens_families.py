# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of all lens models from corners that are known but for noise."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.calibration import Board, calibrate
from orbslam2py.calibration.families import fit_lens
from support.board_corners import CAMERAS, ray_errors, views_everywhere

BOARD = Board(9, 7, 0.03)
#: Root mean square of the distances for noise of 0.05 pixels in x and y.
NOISE = 0.05 * np.sqrt(2)


@pytest.mark.parametrize("family", CAMERAS)
def test_rays_of_every_lens_are_recovered(family: str) -> None:
    true = CAMERAS[family]
    result = calibrate(views_everywhere(true, BOARD), BOARD, model=family)
    assert result.camera.name == family
    assert result.scores == ()
    assert result.rms == pytest.approx(NOISE, rel=0.12)
    assert ray_errors(result.camera, true, result.corners).max() < 0.06
    settings = result.settings(fps=20.0)
    again = Settings.from_yaml(settings.to_yaml(), Sensor.MONOCULAR)
    assert again.camera.camera_model(*true.image_size) == result.camera


@pytest.mark.parametrize("family", ["kannala_brandt", "double_sphere", "eucm"])
def test_views_reach_beyond_the_side_of_wide_lenses(family: str) -> None:
    result = calibrate(views_everywhere(CAMERAS[family], BOARD), BOARD, model=family)
    assert np.degrees(result.angle_seen) > (95 if family == "kannala_brandt" else 70)


def test_a_perspective_lens_is_chosen() -> None:
    family = "radtan4"
    result = calibrate(views_everywhere(CAMERAS[family], BOARD, 8), BOARD)
    assert result.family == family
    scores = {score.family: score for score in result.scores}
    assert [score.family for score in result.scores if score.chosen] == [family]
    assert scores[family].validated == pytest.approx(NOISE, rel=0.15)
    assert scores["pinhole"].rms > 5 * scores["radtan4"].rms
    assert not np.isfinite(scores["pinhole"].validated)


def test_a_wide_lens_is_chosen_and_is_no_pinhole() -> None:
    found = views_everywhere(CAMERAS["kannala_brandt"], BOARD, 8)
    result = calibrate(found, BOARD)
    assert result.family == "kannala_brandt"
    np.testing.assert_allclose(
        result.camera.parameters[:4], CAMERAS["kannala_brandt"].parameters[:4], atol=0.5
    )
    assert np.all(result.deviations[:4] < 0.3)
    warnings = calibrate(found, BOARD, model="pinhole").warnings()
    assert any("does the lens model fit (leave --model out)" in text for text in warnings)


def test_standard_deviations_are_those_of_many_calibrations() -> None:
    errors, sigmas = [], []
    true = CAMERAS["radtan4"]
    for seed in range(6):
        found = views_everywhere(true, BOARD, 8)
        generator = np.random.default_rng(seed)
        for view in found.views:
            view.corners[:] += generator.normal(0, 0.1, view.corners.shape)
        result = calibrate(found, BOARD, model="radtan")
        errors.append(np.array(result.camera.parameters[:2]) - true.parameters[:2])
        sigmas.append(result.deviations[:2])
    ratio = np.sqrt((np.array(errors) ** 2).mean()) / np.sqrt((np.array(sigmas) ** 2).mean())
    assert 0.4 < ratio < 2.0


def test_a_lens_is_fitted_to_rays() -> None:
    true = CAMERAS["double_sphere"]
    pixels = np.array([[u, v] for u in range(20, 500, 40) for v in range(20, 500, 40)], float)
    rays = true.unproject(pixels)
    fit = fit_lens("double_sphere", rays, pixels, (512, 512), (190.0, 190.0), (256.0, 256.0))
    np.testing.assert_allclose(fit.camera.parameters, true.parameters, rtol=1e-4)
    near = fit_lens("kannala_brandt", rays, pixels, (512, 512), (190.0, 190.0), (256.0, 256.0))
    assert 1e-4 < near.rms < 0.1


def test_wrong_models() -> None:
    found = views_everywhere(CAMERAS["radtan4"], BOARD, 6)
    with pytest.raises(SettingsError, match=r"lens model is 'wide'; give one of pinhole, radtan4"):
        calibrate(found, BOARD, model="wide")
    with pytest.raises(SettingsError, match="k3 goes with the model radtan5, not with eucm"):
        calibrate(found, BOARD, model="eucm", k3=True)
