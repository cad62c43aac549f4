# SPDX-License-Identifier: BSD-3-Clause
"""Depth and images as NumPy's masked arrays and matrices."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py import ImageError, Sensor
from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.settings import builtin_settings
from orbslam2py.slam.front_end import FrontEnd

SETTINGS = builtin_settings("tum1", Sensor.RGBD)
NOISE = np.random.default_rng(1).integers(0, 255, (60, 80), dtype=np.uint8)
IMAGE = cv2.resize(NOISE, (640, 480))
DEPTH = np.full((480, 640), 10_000, np.uint16)


def frame_of(image: Any, depth: Any, mask: Any = None) -> core.Frame:
    return FrontEnd(SETTINGS, Sensor.RGBD).rgbd(image, depth, 0, 0.0, StageTimer(), mask)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_depth_that_is_hidden_is_unknown(dtype: type) -> None:
    hidden = np.zeros(DEPTH.shape, bool)
    hidden[:, :320] = True
    frame = frame_of(IMAGE, np.ma.masked_array(DEPTH.astype(dtype), hidden))
    plain = frame_of(IMAGE, np.where(hidden, 0, DEPTH))
    assert (frame.depth > 0).any()
    np.testing.assert_array_equal(frame.depth, plain.depth)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_a_frame_whose_depth_is_all_hidden_has_none(dtype: type) -> None:
    frame = frame_of(IMAGE, np.ma.masked_all(DEPTH.shape, dtype))
    assert frame.size > 100
    assert not (frame.depth > 0).any()


@pytest.mark.filterwarnings("ignore:the matrix subclass")
def test_depth_may_be_a_matrix() -> None:
    np.testing.assert_array_equal(
        frame_of(IMAGE, np.matrix(DEPTH)).depth, frame_of(IMAGE, DEPTH).depth
    )


def test_masked_images_and_masks_are_refused_with_what_to_give() -> None:
    masked = np.ma.masked_array(IMAGE, IMAGE > 100)
    with pytest.raises(ImageError, match=r"^image is a masked array; give its data, .* as mask="):
        frame_of(masked, DEPTH)
    with pytest.raises(ImageError, match=r"^mask is a masked array"):
        frame_of(IMAGE, DEPTH, masked)
