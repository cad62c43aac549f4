# SPDX-License-Identifier: BSD-3-Clause
"""Image files of sequences, good and bad."""

from __future__ import annotations

import os
import socket
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, Sensor
from orbslam2py.datasets import open_sequence
from orbslam2py.datasets.images import quiet_opencv, read_image
from orbslam2py.datasets.masks import read_mask
from support.small_folders import SIZE, image, save


def test_missing_image(tum: Path) -> None:
    (tum / "depth" / "100.105000.png").unlink()
    sequence = open_sequence(tum)
    sequence.load(0)
    with pytest.raises(DatasetError, match=r"100\.105000\.png is listed but missing"):
        sequence.load(1)


@pytest.mark.parametrize("kind", ["rgb/100.100000.png", "depth/100.105000.png"])
def test_a_pipe_is_not_opened(tum: Path, kind: str) -> None:
    path = tum / kind
    path.unlink()
    os.mkfifo(path)
    sequence = open_sequence(tum)
    sequence.load(0)
    with pytest.raises(ImageError, match=rf"{path.name} is a pipe, not a file; replace it"):
        sequence.load(1)
    with pytest.raises(ImageError, match="is a pipe"):
        read_mask(path)


def test_neither_are_sockets_and_devices(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(str(tmp_path / "a.png"))
        with pytest.raises(ImageError, match=r"a\.png is a socket, not a file"):
            read_image(tmp_path / "a.png", rgb=False)
    (tmp_path / "b.png").symlink_to("/dev/zero")
    with pytest.raises(ImageError, match=r"b\.png is a device, not a file"):
        read_image(tmp_path / "b.png", rgb=False)


@pytest.mark.parametrize("kind", ["rgb/100.100000.png", "depth/100.105000.png"])
@pytest.mark.parametrize("fraction", [0.0, 0.01, 0.5, 0.99])
def test_truncated_image(tum: Path, kind: str, fraction: float) -> None:
    path = tum / kind
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * fraction)])
    with pytest.raises(ImageError, match=path.name):
        open_sequence(tum).load(1)


@pytest.mark.parametrize("fraction", [0.3, 0.99])
def test_truncated_jpeg(tum: Path, fraction: float) -> None:
    save(tum / "rgb" / "a.jpg", image(0, (*SIZE, 3)))
    content = (tum / "rgb" / "a.jpg").read_bytes()
    (tum / "rgb.txt").write_text("1.0 rgb/a.jpg\n")
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert sequence.load(0).image.shape == (*SIZE, 3)
    (tum / "rgb" / "a.jpg").write_bytes(content[: int(len(content) * fraction)])
    with pytest.raises(ImageError, match=r"a\.jpg"):
        sequence.load(0)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_truncated_image_that_the_decoder_completes(
    tum: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Older versions of OpenCV fill the rest with grey."""
    path = tum / "rgb" / f"a{suffix}"
    save(path, image(0, (*SIZE, 3)))
    (tum / "rgb.txt").write_text(f"1.0 rgb/{path.name}\n")
    monkeypatch.setattr(cv2, "imdecode", lambda *_: image(0, (*SIZE, 3)))
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert sequence.load(0).image.shape == (*SIZE, 3)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ImageError, match="is truncated"):
        sequence.load(0)


def test_opencv_4_prints_nothing_either(monkeypatch: pytest.MonkeyPatch) -> None:
    levels = [3]
    monkeypatch.delattr(cv2.utils, "logging", raising=False)  # 4 has none
    monkeypatch.setattr(cv2, "getLogLevel", lambda: levels[-1], raising=False)
    monkeypatch.setattr(cv2, "setLogLevel", levels.append, raising=False)
    with pytest.raises(ValueError, match="wrong"), quiet_opencv():
        assert levels == [3, 0]
        raise ValueError("wrong")
    assert levels == [3, 0, 3]


def test_file_that_is_no_image(tum: Path) -> None:
    (tum / "rgb" / "100.100000.png").write_text("no image at all")
    with pytest.raises(ImageError, match=r"100\.100000\.png is no readable image"):
        open_sequence(tum).load(1)


def test_folder_in_place_of_an_image(tum: Path) -> None:
    (tum / "rgb" / "100.100000.png").unlink()
    (tum / "rgb" / "100.100000.png").mkdir()
    with pytest.raises(ImageError, match="cannot read image"):
        open_sequence(tum).load(1)


def test_wrong_kinds_of_pixels(tum: Path) -> None:
    save(tum / "rgb" / "100.100000.png", image(0, dtype=np.uint16))
    save(tum / "depth" / "100.005000.png", image(0, (*SIZE, 3)))
    sequence = open_sequence(tum)
    with pytest.raises(ImageError, match="8 bits per channel"):
        sequence.load(1)
    with pytest.raises(ImageError, match="has 3 channels; depth images have one"):
        sequence.load(0)


@pytest.mark.parametrize("n_channels", [3, 4])
def test_colours_come_in_the_order_that_is_wanted(tmp_path: Path, n_channels: int) -> None:
    pixels = np.random.default_rng(n_channels).integers(0, 256, (203, 641, n_channels), np.uint8)
    path = tmp_path / "colours.png"
    cv2.imwrite(str(path), pixels)
    np.testing.assert_array_equal(read_image(path, rgb=False), pixels)
    rgb = read_image(path, rgb=True)
    np.testing.assert_array_equal(rgb[..., :3], pixels[..., 2::-1])
    np.testing.assert_array_equal(rgb[..., 3:], pixels[..., 3:])


def test_threads_that_overlap_give_the_log_its_level_back() -> None:
    """The second took the silence of the first for the level to return to."""
    logging = getattr(cv2.utils, "logging", cv2)
    before = logging.getLogLevel()
    assert before != 0
    first_is_in, second_is_in = threading.Event(), threading.Event()
    levels = []

    def first() -> None:
        with quiet_opencv():
            first_is_in.set()
            second_is_in.wait(10)

    def second() -> None:
        first_is_in.wait(10)
        with quiet_opencv():
            second_is_in.set()
            threads[0].join()
            levels.append(logging.getLogLevel())

    threads = [threading.Thread(target=first), threading.Thread(target=second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert levels == [0], "silent until the last one is out"
    assert logging.getLogLevel() == before
