# SPDX-License-Identifier: BSD-3-Clause
"""Videos, read back."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]


def read_video(path: Path) -> tuple[list[Picture], float]:
    """All pictures (h, w, 3) RGB, and how many are shown in a second."""
    video = cv2.VideoCapture(str(path))
    assert video.isOpened()
    rate = video.get(cv2.CAP_PROP_FPS)
    pictures = []
    while True:
        found, picture = video.read()
        if not found:
            break
        pictures.append(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8))
    video.release()
    return pictures, rate


def share_of(picture: Picture, colour: tuple[int, int, int], tolerance: int = 45) -> float:
    """How much of a picture has a colour, as far as a codec keeps it."""
    same = np.abs(picture.astype(int) - colour).max(axis=2) < tolerance
    return float(same.mean())
