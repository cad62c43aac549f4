# SPDX-License-Identifier: BSD-3-Clause
"""From images without calibration of their own, as a camera delivers them, to tracked images."""

from __future__ import annotations

import logging
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray
from orbslam2py._sixteen_bits import FollowingRange
from orbslam2py.datasets.base import Images
from orbslam2py.datasets.rectification import Rectifiers, rectifiers_of
from orbslam2py.errors import DatasetError, ImageError
from orbslam2py.settings import Sensor, Settings

_log = logging.getLogger(__name__)

Arrays = dict[str, NDArray[Any]]


class Preparation:
    """Splits, converts and rectifies images.

    Parameters
    ----------
    name
        Name of the source for messages.
    sensor
        Sensor for which the images are used.
    settings
        Order of the colours, size and rectification.
    split
        Whether every image holds the left view in its left half, the right view in its right half.
    """

    def __init__(self, name: object, sensor: Sensor, settings: Settings, *, split: bool) -> None:
        self._name = name
        self._sensor = sensor
        self._settings = settings
        self._split = split
        self._range: FollowingRange | None = None
        self._size_checked = False

    def images(self, arrays: Arrays) -> Images:
        """Make the images of a frame.

        Parameters
        ----------
        arrays
            By stream: ``image``, or ``left`` and ``right``, and perhaps ``depth``.

        Raises
        ------
        DatasetError
            If an image holds two views side by side, and they shall not be split.
        ImageError
            If it cannot be split or rectified.
        """
        first = arrays["left"] if "left" in arrays else arrays["image"]
        halves = self._halves(first)
        if not self._size_checked:
            self.check_size(first)
        left = self._prepared(halves[0])
        if self._sensor is Sensor.RGBD:
            return Images(left, depth=arrays["depth"])
        if self._sensor is Sensor.MONOCULAR:
            return Images(left)
        right = self._prepared(halves[1] if self._split else arrays["right"])
        if self._rectifiers is not None:
            what = "half" if self._split else "image"
            left = self._rectifiers[0].rectify(left, f"the left {what} of {self._name}")
            right = self._rectifiers[1].rectify(right, f"the right {what} of {self._name}")
        return Images(left, right=right)

    def _halves(self, image: NDArray[Any]) -> tuple[NDArray[Any], ...]:
        if not self._split:
            return (image,)
        width = image.shape[1]
        if width % 2:
            raise ImageError(
                f"{self._name} has an image {width} pixels wide: no two halves of equal width; "
                "leave out --split if it does not hold two views side by side"
            )
        return image[:, : width // 2], image[:, width // 2 :]

    def _prepared(self, image: NDArray[Any]) -> ByteArray:
        image = self._in_8_bits(image)
        if image.ndim == 3 and self._settings.camera.rgb:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
        return np.ascontiguousarray(image)

    def _in_8_bits(self, image: NDArray[Any]) -> ByteArray:
        if image.dtype != np.uint16:
            return np.asarray(image, dtype=np.uint8)
        if self._range is None:
            self._range = FollowingRange()
            _log.info("%s: images of 16 bits; scaled to 8 by a range that follows them", self._name)
        return self._range.to_8_bits(image)

    @cached_property
    def _rectifiers(self) -> Rectifiers | None:
        return rectifiers_of(self._settings)

    def check_size(self, image: NDArray[Any]) -> None:
        """Compare the size of an image as it is stored with the one of the settings.

        Raises
        ------
        DatasetError
            If it is twice as wide: it holds two views. Other sizes are warned of.
        """
        self._size_checked = True
        camera = self._settings.camera
        width = image.shape[1] // 2 if self._split else image.shape[1]
        given, found = (camera.width, camera.height), (width, image.shape[0])
        if camera.width is None or camera.height is None or given == found:
            return
        if found == (2 * camera.width, camera.height) and not self._split:
            raise DatasetError(
                f"{self._name} has images of {found[0]} x {found[1]} pixels, twice as wide as "
                f"those of the settings ({given[0]} x {given[1]}): if they hold the left and the "
                "right view side by side, take --split of 'orbslam2py run' (with --sensor mono for "
                "the left one alone); else correct Camera.width in the settings"
            )
        _log.warning(
            "%s has images of %d x %d pixels%s, but the settings are for %d x %d: "
            "focal lengths and distortion do not fit",
            self._name,
            *found,
            " in each half" if self._split else "",
            *given,
        )
