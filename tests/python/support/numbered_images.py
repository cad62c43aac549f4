# SPDX-License-Identifier: BSD-3-Clause
"""Plain images whose shade tells their number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import Sensor, Settings
from orbslam2py.settings import builtin_settings

MONO = Sensor.MONOCULAR
SIZE = (96, 128)  # rows, columns


def coloured(k: int) -> np.ndarray:
    """A plain BGR image whose shade tells its number."""
    pixels = np.zeros((*SIZE, 3), np.uint8)
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 8 * k, 128, 255 - 8 * k
    return pixels


def with_size(name: str) -> Settings:
    settings = builtin_settings(name, MONO)
    return replace(settings, camera=replace(settings.camera, width=752, height=480))


def number_of(bgr: np.ndarray) -> int:
    return round(float(bgr[..., 0].mean()) / 8)


def mask_image(value: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
    mask = np.full(size, 255, np.uint8)
    mask[: size[0] // 2] = value
    return mask


def write_video(path: Path, *, code: str = "mp4v", n: int = 20) -> Path:
    """Frames at 25 per second; skips the test where videos cannot be written."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 25, SIZE[::-1])
    if not writer.isOpened():
        pytest.skip("this OpenCV cannot write videos")
    for k in range(n):
        writer.write(coloured(k))
    writer.release()
    return path
