# SPDX-License-Identifier: BSD-3-Clause
"""Colours of keypoints: in records, and with the keyframes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from orbslam2py import Sensor, System
from orbslam2py.datasets import Images
from orbslam2py.settings.sensor import WITHOUT_RIG
from support.feeding import feed
from support.small_sequences import images, new_system, sequence

pytestmark = pytest.mark.watchdog(30)


def tinted(given: Images) -> Images:
    """The grey images as colour images of another red and blue."""
    grey = given.image if given.image.ndim == 2 else given.image[..., 1]
    right = given.right
    if right is not None and right.ndim == 2:
        right = np.dstack([right] * 3)
    return dataclasses.replace(given, image=np.dstack([grey // 2, grey, 255 - grey]), right=right)


@pytest.mark.parametrize("sensor", WITHOUT_RIG)
@pytest.mark.parametrize("rgb", [True, False])
def test_colours_are_those_of_the_image(sensor: Sensor, rgb: bool) -> None:
    settings = sequence(sensor).settings
    camera = dataclasses.replace(settings.camera, rgb=rgb)
    shown = tinted(images(sensor, 0))
    with System(dataclasses.replace(settings, camera=camera), sensor, deterministic=True) as slam:
        seen = feed(slam, shown, 0.0, details=True).features
        slam_map = slam.pipeline.back_end.map
        if slam.n_keyframes:
            kept = slam_map.keyframe_frame(0)
            assert seen is not None
            np.testing.assert_array_equal(kept.colours, seen.colours)
            np.testing.assert_array_equal(kept.keypoints, seen.keypoints)
    assert seen is not None
    n = len(seen.keypoints)
    assert n > 100 and seen.colours.shape == (n, 3) and seen.colours.dtype == np.uint8
    x, y = np.floor(seen.keypoints.T + 0.5).astype(int)
    expected = shown.image[y, x] if rgb else shown.image[y, x][:, ::-1]
    np.testing.assert_array_equal(seen.colours, expected)


def test_grey_images_have_no_colours() -> None:
    sensor = Sensor.RGBD
    given = images(sensor, 0)
    grey = given.image if given.image.ndim == 2 else np.ascontiguousarray(given.image[..., 1])
    for image in (grey, grey[..., np.newaxis]):
        with new_system(sensor, deterministic=True) as slam:
            shown = dataclasses.replace(given, image=image)
            seen = feed(slam, shown, 0.0, details=True).features
        assert seen is not None and len(seen.keypoints) > 100
        assert seen.colours.shape == (0, 3)
