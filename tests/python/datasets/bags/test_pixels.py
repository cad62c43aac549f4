# SPDX-License-Identifier: BSD-3-Clause
"""Every way in which images lie in bags."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

import orbslam2py as orb
from orbslam2py.datasets import BagSequence
from orbslam2py.settings import Settings, settings_for_camera
from support import bags

RANDOM = np.random.default_rng(5)
GREY = RANDOM.integers(0, 256, (24, 32)).astype(np.uint8)
BGR = cv2.GaussianBlur(RANDOM.integers(0, 256, (24, 32, 3)).astype(np.uint8), (0, 0), 3)
RGB = np.ascontiguousarray(BGR[:, :, ::-1])
MILLIMETRES = RANDOM.integers(0, 9000, (24, 32)).astype(np.uint16)
METRES = (MILLIMETRES / 1000).astype(np.float32)
METRES[0, 0] = np.nan


def settings(sensor: str, *, rgb: bool = True) -> Settings:
    camera = orb.CameraSettings(fx=20, fy=20, cx=15.5, cy=11.5, width=32, height=24, rgb=rgb)
    return settings_for_camera(camera, sensor)


def load(path: Path, message: bags.Made, kind: str, **more: object) -> npt.NDArray[np.generic]:
    bag = bags.write(path / "one", kind, [message])
    return BagSequence(bag, "mono", settings=settings("mono", **more)).load(0).image  # type: ignore[arg-type]


@pytest.fixture(params=bags.KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "stored"),
    [
        ("mono8", GREY),
        ("8UC1", GREY),
        ("bgr8", BGR),
        ("8UC3", BGR),
        ("rgb8", RGB),
        ("bgra8", np.dstack([BGR, GREY])),
        ("rgba8", np.dstack([RGB, GREY])),
    ],
)
def test_raw(
    tmp_path: Path, kind: str, encoding: str, stored: npt.NDArray[np.uint8], padding: int
) -> None:
    message = bags.raw_image("/image", bags.START, stored, encoding, padding=padding)
    expected = GREY if stored.ndim == 2 else RGB
    assert np.array_equal(load(tmp_path, message, kind), expected)


@pytest.mark.parametrize("rgb", [True, False])
def test_colour_order_of_the_settings(tmp_path: Path, rgb: bool) -> None:
    message = bags.raw_image("/image", bags.START, RGB, "rgb8")
    assert np.array_equal(load(tmp_path, message, "mcap", rgb=rgb), RGB if rgb else BGR)


@pytest.mark.parametrize(
    ("encoding", "rows"),
    [
        ("bayer_rggb8", ("RG", "GB")),
        ("bayer_bggr8", ("BG", "GR")),
        ("bayer_gbrg8", ("GB", "RG")),
        ("bayer_grbg8", ("GR", "BG")),
    ],
)
def test_bayer(tmp_path: Path, kind: str, encoding: str, rows: tuple[str, str]) -> None:
    """A plain colour behind the pattern comes out as that colour."""
    colour = {"R": 200, "G": 120, "B": 40}
    pattern = np.array([[colour[name] for name in row] for row in rows], np.uint8)
    stored = np.tile(pattern, (12, 16))
    image = load(tmp_path, bags.raw_image("/image", bags.START, stored, encoding), kind)
    assert image.shape == (24, 32, 3)
    assert (image == [200, 120, 40]).all()


@pytest.mark.parametrize(("encoding", "first"), [("yuv422", "u"), ("yuv422_yuy2", "y")])
def test_yuv(tmp_path: Path, encoding: str, first: str) -> None:
    """Grey values with neutral colour."""
    luma = np.full((24, 32), 120, np.uint8)
    neutral = np.full_like(luma, 128)
    stored = np.dstack([neutral, luma] if first == "u" else [luma, neutral])
    image = load(tmp_path, bags.raw_image("/image", bags.START, stored, encoding), "rosbag1")
    assert image.shape == (24, 32, 3)
    assert np.ptp(image) == 0
    assert 110 < image[0, 0, 0] < 130


def test_png(tmp_path: Path, kind: str) -> None:
    for stored, form in ((GREY, "png"), (BGR, "bgr8; png compressed bgr8")):
        message = bags.packed_image("/i/compressed", bags.START, bags.encoded(stored, ".png"), form)
        (tmp_path / form).mkdir()
        image = load(tmp_path / form, message, kind)
        assert np.array_equal(image, GREY if stored.ndim == 2 else RGB)


def test_jpeg(tmp_path: Path, kind: str) -> None:
    content = bags.encoded(BGR, ".jpg")
    message = bags.packed_image("/i/compressed", bags.START, content, "rgb8; jpeg compressed bgr8")
    expected = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    assert np.array_equal(load(tmp_path, message, kind), expected)


@pytest.mark.parametrize(
    ("message", "expected", "factor"),
    [
        (bags.raw_image("/d/image", 0, MILLIMETRES, "16UC1"), MILLIMETRES, 1000),
        (bags.raw_image("/d/image", 0, MILLIMETRES, "mono16"), MILLIMETRES, 1000),
        (bags.raw_image("/d/image", 0, MILLIMETRES, "16UC1", big_endian=True), MILLIMETRES, 1000),
        (bags.raw_image("/d/image", 0, METRES, "32FC1", padding=8), METRES, 1),
        (
            bags.packed_image("/d/image/compressed", 0, bags.encoded(MILLIMETRES, ".png"), "16UC1"),
            MILLIMETRES,
            1000,
        ),
        (
            bags.packed_image(
                *("/d/image/compressedDepth", 0),
                *(bags.compressed_depth(MILLIMETRES), "16UC1; compressedDepth png"),
            ),
            MILLIMETRES,
            1000,
        ),
    ],
)
def test_depth(
    tmp_path: Path, kind: str, message: bags.Made, expected: npt.NDArray[np.generic], factor: float
) -> None:
    name = message.topic.replace("/d/", "/depth/")
    depth = bags.Made(name, message.kind, bags.START, message.fields)
    messages = [
        bags.raw_image("/rgb/image", bags.START, RGB, "rgb8"),
        bags.camera_info("/rgb/camera_info", bags.START),
        depth,
    ]
    sequence = BagSequence(bags.write(tmp_path / "rgbd", kind, messages))
    assert str(sequence.sensor) == "rgbd"
    assert sequence.settings.depth is not None
    assert sequence.settings.depth.raw_per_metre == factor
    loaded = sequence.load(0).depth
    assert loaded is not None
    assert loaded.dtype == expected.dtype
    assert np.array_equal(loaded, expected, equal_nan=loaded.dtype.kind == "f")


def test_inverse_depth(tmp_path: Path) -> None:
    """Depth in metres that compressedDepth scaled: A / depth + B."""
    scale, shift = 1000.0, 3.0
    raw = np.where(METRES > 0.1, scale / np.maximum(METRES, 0.1) + shift, 0).astype(np.uint16)
    content = bags.compressed_depth(raw, scale, shift)
    messages = [
        bags.raw_image("/rgb/image", bags.START, RGB, "rgb8"),
        bags.packed_image("/depth/compressedDepth", bags.START, content, "32FC1; compressedDepth"),
    ]
    bag = bags.write(tmp_path / "rgbd", "rosbag2", messages)
    depth = BagSequence(bag, "rgbd", settings=settings("rgbd")).load(0).depth
    assert depth is not None
    known = METRES > 0.1
    assert (depth[~known] == 0).all()
    assert np.allclose(depth[known], METRES[known], rtol=0.02)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (bags.raw_image("/image", 0, MILLIMETRES, "rgb16"), "encoding is rgb16; known are mono8"),
        (
            bags.Made("/image", bags.IMAGE, 0, (24, 32, "mono8", 0, 32, GREY.reshape(-1)[:99])),
            "damaged: 99 bytes for 32 x 24",
        ),
        (bags.packed_image("/i/compressed", 0, b"no image", "jpeg"), "no readable image"),
        (bags.packed_image("/i/compressed", 0, bags.encoded(BGR, ".jpg")[:99], "jpeg"), "truncat"),
    ],
)
def test_images_that_cannot_be_read(tmp_path: Path, message: bags.Made, reason: str) -> None:
    bag = bags.write(tmp_path / "bad", "mcap", [message])
    with pytest.raises(orb.DatasetError, match=f"images that cannot be read.*{reason}"):
        BagSequence(bag, settings=settings("mono"))


def test_an_image_of_another_size_is_left_out(tmp_path: Path) -> None:
    """Compressed images tell their size only when they are decoded."""
    messages = [
        bags.packed_image("/i", bags.START + i * bags.STEP, bags.encoded(image, ".png"), "png")
        for i, image in enumerate([GREY, GREY[:20], GREY])
    ]
    sequence = BagSequence(bags.write(tmp_path / "b", "mcap", messages), settings=settings("mono"))
    sequence.load(2)
    with pytest.raises(orb.ImageError, match="is 32 x 20, the first one 32 x 24"):
        sequence.load(1)


# ---- 16 bits of grey -----------------------------------------------------------------------------
@pytest.mark.parametrize("packed", [False, True])
def test_grey_values_of_16_bits(
    tmp_path: Path, kind: str, packed: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """The only topic is mono16: an image, and all of the bag are scaled alike."""
    stored = [GREY.astype(np.uint16) * 40 + np.uint16(1000 * i) for i in range(4)]
    messages = [
        bags.packed_image("/i", stamp, bags.encoded(image, ".png"), "mono16; png compressed")
        if packed
        else bags.raw_image("/i", stamp, image, "mono16", big_endian=True)
        for stamp, image in ((bags.START + i * bags.STEP, one) for i, one in enumerate(stored))
    ]
    sequence = BagSequence(bags.write(tmp_path / "b", kind, messages), settings=settings("mono"))
    with caplog.at_level("INFO"):
        images = [sequence.load(i).image for i in (3, 0)]
    low, high = 0, 255 * 40 + 3000
    for image, raw in zip(images, (stored[3], stored[0]), strict=True):
        assert image.dtype == np.uint8
        expected = (raw.astype(float) - low) * 255 / (high - low)
        assert np.abs(image - expected).max() < 4
    assert caplog.text.count("images of 16 bits; in all images, grey values") == 1


def test_16UC1_is_depth_unless_it_is_named_as_the_image(tmp_path: Path) -> None:
    messages = [bags.raw_image("/thermal", bags.START, MILLIMETRES, "16UC1")]
    bag = bags.write(tmp_path / "b", "mcap", messages)
    with pytest.raises(orb.DatasetError, match=r"/thermal \(sensor_msgs/msg/Image, 16UC1"):
        BagSequence(bag, "mono", settings=settings("mono"))
    sequence = BagSequence(bag, "mono", settings=settings("mono"), topics="image=/thermal")
    image = sequence.load(0).image
    assert image.dtype == np.uint8
    assert np.corrcoef(image.reshape(-1), MILLIMETRES.reshape(-1))[0, 1] > 0.999


def test_registered_depth_may_be_smaller(tmp_path: Path) -> None:
    small = np.ascontiguousarray(MILLIMETRES[::2, ::2])
    messages = [
        bags.raw_image("/rgb/image", bags.START, RGB, "rgb8"),
        bags.raw_image("/depth_registered/image", bags.START, small, "16UC1"),
    ]
    bag = bags.write(tmp_path / "b", "mcap", messages)
    loaded = BagSequence(bag, "rgbd", settings=settings("rgbd")).load(0)
    assert np.array_equal(loaded.depth, small)  # type: ignore[arg-type]
