# SPDX-License-Identifier: BSD-3-Clause
"""Rectification of raw stereo pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py._arrays import ByteArray
from orbslam2py.errors import ImageError
from orbslam2py.settings import CameraRectification, Settings
from orbslam2py.settings.rectify import core_rectifier, rectification_of_pair

__all__ = [
    "Rectifier",
    "Rectifiers",
    "rectification_of_pair",
    "rectifiers_of",
    "with_rectified_images",
]


class Rectifier:
    """Rectifies the images of one camera of a pair, as `orbslam2py.System` does.

    Parameters
    ----------
    camera
        Raw and rectified calibration.
    """

    def __init__(self, camera: CameraRectification) -> None:
        self._size = (camera.height, camera.width)
        self._rectifier = core_rectifier(camera)

    def rectify(self, image: ByteArray, what: object = "image") -> ByteArray:
        """Resample an image bilinearly; black where the raw image has no pixels.

        Parameters
        ----------
        image
            Raw image (h, w) or (h, w, channels) of the calibrated size.
        what
            Name of the image for the message.

        Raises
        ------
        ImageError
            If the size is not that of the calibration.
        """
        if image.shape[:2] != self._size:
            height, width = self._size
            raise ImageError(
                f"{what} is {image.shape[1]} x {image.shape[0]}, but the rectification is for "
                f"{width} x {height}"
            )
        return self._rectifier.rectify(np.ascontiguousarray(image))


#: Of the left and of the right camera.
Rectifiers = tuple[Rectifier, Rectifier]


def rectifiers_of(settings: Settings) -> Rectifiers | None:
    """Make the rectification of a pair; None if its images are already rectified."""
    pair = settings.rectification
    return None if pair is None else (Rectifier(pair.left), Rectifier(pair.right))


def with_rectified_images(settings: Settings) -> Settings:
    """Return the settings for images that were rectified by them, so that no one does it again."""
    pair = settings.rectification
    if pair is None or pair.applied:
        return settings
    return replace(settings, rectification=replace(pair, applied=True))
