# SPDX-License-Identifier: BSD-3-Clause
"""Masks in the front end."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orbslam2py import ImageError, Sensor
from orbslam2py._timing import StageTimer
from orbslam2py.settings import builtin_settings
from orbslam2py.slam.front_end import FrontEnd


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_no_keypoint_lies_where_the_mask_is_0(sensor: Sensor) -> None:
    generator = np.random.default_rng(1)
    image = cv2.resize(generator.integers(0, 255, (60, 80), dtype=np.uint8), (640, 480))
    mask = np.full((480, 640), 255, np.uint8)
    mask[:, :300] = 0
    settings = builtin_settings("euroc" if sensor is Sensor.STEREO else "tum1", sensor)
    front = FrontEnd(settings, sensor)
    if sensor is Sensor.STEREO:
        frames = [front.stereo(image, image, 0, 0.0, StageTimer(), m) for m in (None, (mask, None))]
    else:
        depth = np.ones((480, 640), np.uint16)
        frames = [front.rgbd(image, depth, 0, 0.0, StageTimer(), m) for m in (None, mask)]
    assert frames[0].keypoints[:, 0].min() < 100
    assert frames[1].keypoints[:, 0].min() >= 300
    assert frames[1].size > 100


def test_front_end_refuses_masks_that_do_not_fit() -> None:
    image = np.zeros((480, 640), np.uint8)
    front = FrontEnd(builtin_settings("euroc", Sensor.STEREO), Sensor.STEREO)
    with pytest.raises(ImageError, match=r"right mask has shape \(480, 600\)"):
        front.stereo(image, image, 0, 0.0, StageTimer(), (None, image[:, :600]))
    with pytest.raises(ImageError, match=r"left mask must be .* uint8 .*got bool"):
        front.stereo(image, image, 0, 0.0, StageTimer(), image > 0)  # type: ignore[arg-type]
