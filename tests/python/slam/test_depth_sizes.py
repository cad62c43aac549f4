# SPDX-License-Identifier: BSD-3-Clause
"""Depth that is smaller than its image: enlarged where that is right, else refused truly."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import ImageError, Sensor
from orbslam2py._depth_size import depth_size_problem, enlarged_depth
from support.small_sequences import images, new_system


@pytest.mark.parametrize("dtype", ["u2", "i4", "f4", "f8"])
def test_nearest_neighbour(dtype: str) -> None:
    depth = np.array([[1, 2], [3, 4]], dtype)
    larger = enlarged_depth(depth, (4, 6, 3))
    assert larger.dtype == depth.dtype
    rows = [[1, 1, 1, 2, 2, 2]] * 2 + [[3, 3, 3, 4, 4, 4]] * 2
    assert larger.tolist() == rows


def test_the_pixel_that_covers_the_centre() -> None:
    """Sizes that are no multiples: 3 columns to 5, whose centres are at 0.3, 0.9, 1.5, 2.1, 2.7."""
    assert enlarged_depth(np.array([[1, 2, 3]]), (1, 5)).tolist() == [[1, 1, 2, 3, 3]]


@pytest.mark.parametrize(
    ("depth", "image"),
    [
        ((192, 256), (1440, 1920)),  # a phone with a LiDAR
        ((180, 320), (720, 1280)),
        ((270, 480), (1080, 1920, 3)),
        ((267, 400), (800, 1200)),  # a third, rounded
    ],
)
def test_sizes_that_fit(depth: tuple[int, ...], image: tuple[int, ...]) -> None:
    assert depth_size_problem(depth, image) is None
    assert enlarged_depth(np.zeros(depth, np.uint16), image).shape == image[:2]


@pytest.mark.parametrize(
    ("depth", "image", "message"),
    [
        ((192, 256), (1080, 1920), r"ratio (1.333 and 1.778)"),
        ((480, 640), (720, 1280), r"ratio (1.333 and 1.778)"),
        ((256, 192), (1440, 1920), r"ratio (0.750 and 1.333)"),
        (
            (960, 1280),
            (480, 640),
            r"cv2.resize(depth, (640, 480), interpolation=",
        ),
        ((0, 640), (480, 640), "give depth images with pixels"),
    ],
)
def test_sizes_that_do_not(depth: tuple[int, ...], image: tuple[int, ...], message: str) -> None:
    problem = depth_size_problem(depth, image)
    assert problem is not None
    assert message in problem
    assert f"{depth[1]}x{depth[0]}, the image {image[1]}x{image[0]}" in problem


def test_small_depth_is_tracked_and_told_once(caplog: pytest.LogCaptureFixture) -> None:
    shown = images(Sensor.RGBD, 0)
    assert shown.depth is not None
    small = shown.depth[::2, ::2]
    large = np.repeat(np.repeat(small, 2, axis=0), 2, axis=1)
    with (
        new_system(Sensor.RGBD, deterministic=True) as system,
        new_system(Sensor.RGBD, deterministic=True) as other,
    ):
        for k in range(3):
            found = system.track_rgbd(shown.image, small, k / 20, details=True).features
            expected = other.track_rgbd(shown.image, large, k / 20, details=True).features
            assert found is not None
            assert expected is not None
            assert (found.depths > 0).sum() > 100
            assert np.array_equal(found.depths, expected.depths)
    told = [text for text in caplog.messages if "enlarged by nearest neighbour" in text]
    assert len(told) == 1
    assert "depth is 160x120, the images 320x240" in told[0]


def test_depth_of_another_view_is_refused() -> None:
    shown = images(Sensor.RGBD, 0)
    with (
        new_system(Sensor.RGBD, deterministic=True) as system,
        pytest.raises(ImageError, match="do not show the same view; register depth"),
    ):
        system.track_rgbd(shown.image, np.ones((100, 320), np.uint16), 0.0)


def test_16_bits_name_the_line_of_python() -> None:
    deep = images(Sensor.MONOCULAR, 0).image.astype(np.uint16) * 200
    with (
        new_system(Sensor.MONOCULAR, deterministic=True) as system,
        pytest.raises(ImageError, match=r"got uint16; .*np\.clip\(image, low, high"),
    ):
        system.track_monocular(deep, 0.0)
