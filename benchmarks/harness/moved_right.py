# SPDX-License-Identifier: BSD-3-Clause
"""Stereo recordings whose right images are moved by a part of a pixel.

Rectification that is off by that much makes all disparities too large or too small, which nothing
but such a move takes out. Away from the borders exact for images without detail finer than two
pixels (Fourier's shift theorem); grey values are rounded to eight bits.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray

# Columns mirrored at either border, so that one border does not shine through at the other.
_MARGIN = 32
#: Less than so many pixels, of which none comes in from beyond the mirror.
MOST_MOVED = _MARGIN / 2


def moved_left(image: ByteArray, pixels: float) -> ByteArray:
    """A grey image whose content lies further left: of a right one, all disparities are larger.

    Parameters
    ----------
    image : array of uint8, (h, w)
        At least 33 columns.
    pixels : float
        How far; negative: to the right. Less than `MOST_MOVED` to either side.
    """
    padded = np.pad(image.astype(np.float64), ((0, 0), (_MARGIN, _MARGIN)), mode="reflect")
    frequencies = np.fft.rfftfreq(padded.shape[1])
    spectrum = np.fft.rfft(padded, axis=1) * np.exp(2j * np.pi * frequencies * pixels)
    moved = np.fft.irfft(spectrum, n=padded.shape[1], axis=1)[:, _MARGIN:-_MARGIN]
    grey: ByteArray = np.clip(np.rint(moved), 0, 255).astype(np.uint8)
    return grey


def with_moved_right_images(folder: Path, pixels: float, copy: Path) -> Path:
    """A KITTI sequence whose right images (``image_1``) are moved left.

    Parameters
    ----------
    folder : Path
        The sequence, which is not changed, and has to stay: all else is linked to it.
    pixels : float
        See `moved_left`.
    copy : Path
        A folder to be made.

    Returns
    -------
    Path
        `copy`.

    Raises
    ------
    ValueError
        If `folder` has no right images in KITTI's layout.
    OSError
        If one cannot be written.
    """
    names = sorted(path.name for path in (folder / "image_1").glob("*.png"))
    if not names:
        raise ValueError(f"{folder} has no right images image_1/*.png")
    # Made, not copied: where the sequence may not be written to, neither may a copy of it.
    (copy / "image_1").mkdir(parents=True)
    for entry in folder.iterdir():
        if entry.name != "image_1":
            (copy / entry.name).symlink_to(entry.resolve())
    for name in names:
        image = cv2.imread(str(folder / "image_1" / name), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ValueError(f"{folder / 'image_1' / name} is no image")
        moved = copy / "image_1" / name
        if not cv2.imwrite(str(moved), moved_left(image, pixels)):
            raise OSError(f"{moved} cannot be written")
    return copy
