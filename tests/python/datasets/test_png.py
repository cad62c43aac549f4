# SPDX-License-Identifier: BSD-3-Clause
"""PNG files: what the package decodes itself equals OpenCV's, and the rest is left to it."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from orbslam2py import _core as core
from orbslam2py.datasets.images import decode_any
from orbslam2py.errors import ImageError


def by_opencv(content: bytes) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED))


def pixels(shape: tuple[int, ...], dtype: type, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    smooth = np.add.outer(np.arange(shape[0]) * 3, np.arange(shape[1]) * 2)
    noise = generator.integers(0, 20, shape)
    ramp = smooth.reshape(*smooth.shape, *(1,) * (len(shape) - 2)) + noise
    return (ramp * (137 if dtype is np.uint16 else 1)).astype(dtype)


def png(image: np.ndarray, compression: int = 3) -> bytes:
    done, content = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    assert done
    return content.tobytes()


def saved(image: Image.Image, **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, "PNG", **options)
    return file.getvalue()


@given(
    height=st.integers(1, 40),
    width=st.integers(1, 40),
    channels=st.sampled_from([1, 3, 4]),
    dtype=st.sampled_from([np.uint8, np.uint16]),
    compression=st.integers(0, 9),
    seed=st.integers(0, 1000),
)
def test_same_pixels_as_opencv(
    height: int, width: int, channels: int, dtype: type, compression: int, seed: int
) -> None:
    shape = (height, width) if channels == 1 else (height, width, channels)
    image = pixels(shape, dtype, seed)
    content = png(image, compression)
    decoded = core.decode_png(content)
    assert decoded is not None
    assert decoded.dtype == image.dtype
    np.testing.assert_array_equal(decoded, image)
    np.testing.assert_array_equal(decoded, by_opencv(content))


def test_another_encoder_with_other_filters() -> None:
    image = pixels((120, 161, 3), np.uint8, 1)
    content = saved(Image.fromarray(image), optimize=True)
    np.testing.assert_array_equal(core.decode_png(content), image[:, :, ::-1])


@pytest.mark.parametrize("mode", ["P", "1", "LA"])
def test_other_kinds_are_opencvs(mode: str) -> None:
    content = saved(Image.fromarray(pixels((20, 30), np.uint8, 2)).convert(mode))
    assert core.decode_png(content) is None
    np.testing.assert_array_equal(decode_any(content, "it"), by_opencv(content))


def test_a_transparent_colour_is_opencvs() -> None:
    image = Image.fromarray(pixels((20, 30, 3), np.uint8, 3))
    content = saved(image, transparency=(1, 2, 3))
    assert core.decode_png(content) is None
    np.testing.assert_array_equal(decode_any(content, "it"), by_opencv(content))


def test_several_images_in_one_file_are_opencvs() -> None:
    first, second = (Image.fromarray(pixels((20, 30, 3), np.uint8, seed)) for seed in (4, 5))
    assert core.decode_png(saved(first, save_all=True, append_images=[second])) is None


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.95])
def test_a_truncated_file_is_no_image(share: float) -> None:
    content = png(pixels((60, 80), np.uint8, 6))
    part = content[: int(share * len(content))]
    assert core.decode_png(part) is None
    with pytest.raises(ImageError, match=r"depth 7\.png"):
        decode_any(part, "depth 7.png")


def test_content_that_is_no_png_is_none() -> None:
    done, jpeg = cv2.imencode(".jpg", pixels((60, 80), np.uint8, 7))
    assert done
    assert core.decode_png(jpeg.tobytes()) is None
    assert core.decode_png(b"") is None
