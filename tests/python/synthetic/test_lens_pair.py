# SPDX-License-Identifier: BSD-3-Clause
"""Raw pairs of synthetic sequences: written, read back, and judged by their images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import SettingsError, open_sequence
from orbslam2py.calibration.data_misfit import find_pair_misfit
from orbslam2py.calibration.pair_rows import measure_curves
from orbslam2py.settings import FitThresholds
from orbslam2py.synthetic import SyntheticOptions
from support.raw_pairs import distorted_pair, fisheye_pair, seen_through


@pytest.mark.parametrize("degrees", [90, 195])
def test_a_written_pair_is_read_back(tmp_path: Path, degrees: float) -> None:
    sequence = seen_through(fisheye_pair(degrees))
    sequence.write(tmp_path / "pair")
    read = open_sequence(tmp_path / "pair", "stereo")
    assert read.settings == sequence.settings
    truth = read.ground_truth()
    assert truth is not None
    moved = np.linalg.inv(truth.T_wc[0]) @ truth.T_wc[1]
    np.testing.assert_allclose(moved, np.linalg.inv(sequence.T_wc(0)) @ sequence.T_wc(1), atol=1e-9)
    images, raw = read.load(0), sequence.load(0)
    assert images.right is not None
    if degrees == 195:
        np.testing.assert_array_equal(images.image, raw.image)
        np.testing.assert_array_equal(images.right, raw.right)
    else:
        assert read.settings.rectification is not None
        assert read.settings.rectification.applied
        assert (images.image != raw.image).any()


def test_images_of_a_fisheye_pair_tell_that_they_are_swapped() -> None:
    settings = fisheye_pair(150)
    images = seen_through(settings).load(0)
    assert images.right is not None
    right = measure_curves(images.image, images.right, settings)
    assert right is not None
    assert right.n_points > 100
    assert right.row_difference < 0.5
    assert right.wrong_sign < 0.05
    limits = FitThresholds()
    assert find_pair_misfit([right], limits, fisheye=True) is None
    swapped = measure_curves(images.right, images.image, settings)
    assert swapped is not None
    misfit = find_pair_misfit([swapped], limits, fisheye=True)
    assert misfit is not None
    assert "left and right image are swapped or not taken at one time" in str(misfit)


def test_settings_without_a_raw_pair() -> None:
    settings = distorted_pair()
    for options, told in (
        ({"sensor": "mono"}, "lens_pair is for the sensor stereo; give lens for one camera"),
        ({"size": (320, 240)}, "sets size and lenses of both cameras; leave size and lens out"),
        ({"blur": 0.5}, "goes without blur and imu; leave them out"),
        ({"lens_pair": "euroc"}, "lens_pair is 'euroc'; give Settings of a raw pair"),
    ):
        with pytest.raises(SettingsError, match=told):
            SyntheticOptions(**{"sensor": "stereo", "lens_pair": settings, **options})  # type: ignore[arg-type]
