# SPDX-License-Identifier: BSD-3-Clause
"""Grey images of 16 bits: one range for a sequence, in every layout; and what is depth."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from orbslam2py import DatasetError, ImageError, Sensor, open_sequence
from orbslam2py._sixteen_bits import LINE_OF_PYTHON, FollowingRange, GreyRange, range_of
from orbslam2py.datasets import LiveCamera, open_input
from orbslam2py.datasets.images import read_any, read_image
from orbslam2py.settings import builtin_settings
from support.small_folders import save

MONO = builtin_settings("tum1", Sensor.MONOCULAR)
STEREO = builtin_settings("kitti04-12", Sensor.STEREO)
RAMP = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)


def thermal(folder: Path, n: int = 20) -> Path:
    """Images of 14 bits, each brighter than the one before: 7000 + 10 k to 10071 + 10 k."""
    for k in range(n):
        save(folder / f"{k:04d}.png", RAMP + np.uint16(7000 + 10 * k))
    return folder


def scaled(raw: npt.NDArray[np.generic], low: float, high: float) -> npt.NDArray[np.float64]:
    return np.clip((np.asarray(raw, np.float64) - low) * 255 / (high - low), 0, 255)


def test_one_range_for_the_whole_sequence(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    sequence = open_input(thermal(tmp_path / "t"), settings=MONO)
    with caplog.at_level(logging.INFO):
        images = [sequence.load(i).image for i in (7, 0, 19)]  # type: ignore[union-attr]
    (note,) = [r.getMessage() for r in caplog.records if r.levelno == logging.INFO]
    assert "images of 16 bits; in all images, grey values" in note
    assert "(the range of 16 sample images)" in note
    chosen = range_of([RAMP + np.uint16(7000 + 10 * k) for k in range(20)])
    assert chosen.low == pytest.approx(7000, abs=30)
    assert chosen.high == pytest.approx(10071 + 190, abs=30)
    for k, image in zip((7, 0, 19), images, strict=True):
        assert image.dtype == np.uint8
        assert np.abs(image - scaled(RAMP + 7000 + 10 * k, chosen.low, chosen.high)).max() < 3
    assert images[1].mean() < images[0].mean() < images[2].mean()


def test_the_range_does_not_depend_on_the_first_frame_asked_for(tmp_path: Path) -> None:
    folder = thermal(tmp_path / "t")
    first, second = (open_input(folder, settings=MONO) for _ in range(2))
    first.load(19)  # type: ignore[union-attr]
    assert np.array_equal(first.load(3).image, second.load(3).image)  # type: ignore[union-attr]


def test_the_full_range_of_16_bits(tmp_path: Path) -> None:
    eight = np.tile(np.arange(256, dtype=np.uint8), (64, 1))
    save(tmp_path / "t" / "0.png", eight.astype(np.uint16) * 257)
    image = open_input(tmp_path / "t", settings=MONO).load(0).image  # type: ignore[union-attr]
    assert np.abs(image.astype(int) - eight).max() <= 1


def test_threads_choose_one_range(tmp_path: Path) -> None:
    sequence = open_input(thermal(tmp_path / "t"), settings=MONO)
    found: list[bytes] = []
    work = [
        threading.Thread(target=lambda: found.append(sequence.load(5).image.tobytes()))  # type: ignore[union-attr]
        for _ in range(4)
    ]
    for thread in work:
        thread.start()
    for thread in work:
        thread.join()
    assert len(set(found)) == 1


def deepen(folder: Path) -> None:
    """Make 16 bits of the 8 bits of all images, times 200."""
    for path in folder.rglob("*.png"):
        image = read_any(path)
        if image.dtype == np.uint8:
            grey = image if image.ndim == 2 else image[:, :, 0]
            save(path, grey.astype(np.uint16) * 200)


def test_kitti(kitti: Path) -> None:
    before = [open_sequence(kitti).load(i) for i in range(3)]
    deepen(kitti)
    sequence = open_sequence(kitti)
    for k in range(3):
        images = sequence.load(k)
        assert images.right is not None
        assert before[k].right is not None
        assert np.abs(images.image.astype(int) - before[k].image).max() <= 2
        assert np.abs(images.right.astype(int) - before[k].right).max() <= 2


def test_euroc(euroc: Path) -> None:
    before = open_sequence(euroc, "mono").load(1).image
    deepen(euroc)
    assert np.abs(open_sequence(euroc, "mono").load(1).image.astype(int) - before).max() <= 2


def test_a_pair_in_folders(tmp_path: Path) -> None:
    thermal(tmp_path / "p" / "left", 3)
    thermal(tmp_path / "p" / "right", 3)
    images = open_sequence(tmp_path / "p", settings=STEREO).load(1)
    assert images.image.dtype == np.uint8
    assert np.array_equal(images.image, images.right)


# ---- depth is no image ---------------------------------------------------------------------------
def test_depth_in_the_place_of_images(tum: Path) -> None:
    for path in (tum / "rgb").iterdir():
        save(path, np.full((48, 64), 1000, np.uint16))
    with pytest.raises(DatasetError, match=r"looks like a depth image .* exchanged"):
        open_input(tum, "rgbd")
    with pytest.raises(ImageError, match="looks like a depth image"):
        open_sequence(tum, "rgbd").load(0)


def test_a_folder_of_depth(tmp_path: Path) -> None:
    thermal(tmp_path / "depth")
    with pytest.raises(DatasetError, match=r"0000.png looks like a depth image"):
        open_input(tmp_path / "depth", "mono", settings=MONO)


def test_only_depth_in_two_folders(tmp_path: Path) -> None:
    thermal(tmp_path / "p" / "rgb", 2)
    thermal(tmp_path / "p" / "depth", 2)
    remedy = r"all of them look like depth images.*or give one of these folders alone"
    with pytest.raises(DatasetError, match=remedy):
        open_input(tmp_path / "p", settings=builtin_settings("tum1", Sensor.RGBD))


def test_many_zeros_are_doubtful(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    image = RAMP + np.uint16(500)
    image[:10] = 0
    save(tmp_path / "t" / "0.png", image)
    open_input(tmp_path / "t", settings=MONO).load(0)  # type: ignore[union-attr]
    assert "21 % of the pixels are 0, as in depth images" in caplog.text


def test_where_no_range_is_known_the_line_is_told(tmp_path: Path) -> None:
    save(tmp_path / "x.png", RAMP)
    with pytest.raises(ImageError, match=r"uint16 pixels.*np\.clip\(image, low, high\)"):
        read_image(tmp_path / "x.png", rgb=False)


# ---- the mechanism -------------------------------------------------------------------------------
def test_the_line_of_python_does_it() -> None:
    names = {"np": np, "image": RAMP + np.uint16(7000), "low": 7500, "high": 9500}
    exec(LINE_OF_PYTHON, names)
    expected = scaled(RAMP + 7000, 7500, 9500)
    assert names["image"].dtype == np.uint8
    assert np.abs(np.asarray(names["image"], float) - expected).max() <= 1


@pytest.mark.parametrize("value", [0, 700, 65535])
def test_a_single_value(value: int) -> None:
    image = np.full((8, 8), value, np.uint16)
    chosen = range_of([image])
    assert chosen.high > chosen.low
    assert len(np.unique(chosen.to_8_bits(image))) == 1


def test_values_outside_the_range() -> None:
    scale = GreyRange(1000, 2000)
    image = np.array([[0, 999, 1000, 1500, 2000, 65535]], np.uint16)
    assert scale.to_8_bits(image).tolist() == [[0, 0, 0, 128, 255, 255]]


def test_a_range_that_follows() -> None:
    following = FollowingRange()
    first = following.to_8_bits(RAMP)
    assert np.abs(first - scaled(RAMP, 3, 3068)).max() < 2
    brighter = RAMP + np.uint16(3000)
    jump = following.to_8_bits(brighter)
    assert jump.mean() > 240, "one image alone does not move it far"
    for _ in range(400):
        after = following.to_8_bits(brighter)
    assert np.abs(after - scaled(brighter, 3003, 6068)).max() < 2


class SixteenBits:
    """A camera of 16 bits."""

    def isOpened(self) -> bool:
        return True

    def set(self, prop: int, value: float, /) -> bool:
        return True

    def read(self) -> tuple[bool, npt.NDArray[np.uint16]]:
        return True, RAMP + np.uint16(7000)

    def release(self) -> None:
        pass


def test_a_camera_of_16_bits() -> None:
    opener: Callable[[int], SixteenBits] = lambda number: SixteenBits()  # noqa: E731
    with LiveCamera(0, settings=MONO, open_capture=opener) as camera:
        frame = camera.take(5.0)
    assert frame is not None
    assert np.abs(frame.images.image - scaled(RAMP + 7000, 7003, 10068)).max() < 2
