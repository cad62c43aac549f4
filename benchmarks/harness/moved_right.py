# SPDX-License-Identifier: BSD-3-Clause
"""Stereo recordings whose right images are moved by a part of a pixel.

Rectification that is off by that much makes all disparities too large or too small, which nothing
but such a move takes out again. Exact for images without detail finer than two pixels (Fourier's
shift theorem); grey values are rounded to eight bits.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray

# Columns mirrored at either border, so that one border does not shine through at the other.
_MARGIN = 32


def moved_left(image: ByteArray, pixels: float) -> ByteArray:
    """A grey image whose content lies further left: of a right one, all disparities are larger.

    Parameters
    ----------
    image : array of uint8, (h, w)
        At least 33 columns.
    pixels : float
        How far; negative: to the right.
    """
    padded = np.pad(image.astype(np.float64), ((0, 0), (_MARGIN, _MARGIN)), mode="reflect")
    frequencies = np.fft.rfftfreq(padded.shape[1])
    spectrum = np.fft.rfft(padded, axis=1) * np.exp(2j * np.pi * frequencies * pixels)
    moved = np.fft.irfft(spectrum, n=padded.shape[1], axis=1)[:, _MARGIN:-_MARGIN]
    grey: ByteArray = np.clip(np.rint(moved), 0, 255).astype(np.uint8)
    return grey


def with_moved_right_images(folder: Path, pixels: float, copy: Path) -> Path:
    """Copy a KITTI sequence, its right images (``image_1``) moved left by so many pixels.

    Parameters
    ----------
    folder : Path
        The sequence, which is not changed.
    pixels : float
        See `moved_left`.
    copy : Path
        Where the copy goes; must not exist.

    Returns
    -------
    Path
        `copy`.

    Raises
    ------
    ValueError
        If `folder` has no right images in KITTI's layout.
    """
    names = sorted(path.name for path in (folder / "image_1").glob("*.png"))
    if not names:
        raise ValueError(f"{folder} has no right images image_1/*.png")
    shutil.copytree(folder, copy)
    for name in names:
        image = cv2.imread(str(copy / "image_1" / name), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ValueError(f"{folder / 'image_1' / name} is no image")
        cv2.imwrite(str(copy / "image_1" / name), moved_left(image, pixels))
    return copy
