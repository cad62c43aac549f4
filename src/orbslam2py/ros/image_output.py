# SPDX-License-Identifier: BSD-3-Clause
"""Images with their keypoints as topics, for viewers."""

from __future__ import annotations

import time
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._palette import MAPPED, UNMATCHED
from orbslam2py.ros import messages
from orbslam2py.ros.base_frame import BaseFrame
from orbslam2py.ros.messages import Heading
from orbslam2py.ros.transport import NODE, Publication, Transport
from orbslam2py.ros.types import to_cdr
from orbslam2py.slam.system import System
from orbslam2py.slam.watched_frame import WatchedFrame

#: Most images per second, unless every one is wanted.
_RATE = 15.0
_JPEG_QUALITY = 85
_TOPICS = {
    "image": messages.IMAGE,
    "keypoints": messages.MARKER,
    "camera_info": messages.CAMERA_INFO,
}


@dataclass(frozen=True, eq=False)
class SeenImage:
    """A copy of image and keypoints.

    Attributes
    ----------
    image
        Grey (h, w), or colour (h, w, 3) in the order BGR.
    pixels
        (n, 2) keypoints in the image.
    matched
        (n,) which belong to a point that the pose was found with.
    """

    image: ByteArray
    pixels: npt.NDArray[np.float32]
    matched: npt.NDArray[np.bool_]


class ImageOutput:
    """Publishes images, their keypoints and the calibration of the camera.

    Parameters
    ----------
    transport, system, base
        As for `RosOutput`.
    every
        Whether no image is passed over.
    wanted
        Whether any is published.
    """

    def __init__(
        self, transport: Transport, system: System, base: BaseFrame, *, every: bool, wanted: bool
    ) -> None:
        self._wanted, self._period = wanted, 0.0 if every else 1.0 / _RATE
        self._due = 0.0
        self._frame, self._camera = base.camera, system.settings.camera
        self._rgb = self._camera.rgb
        self._out: dict[str, Publication] = {}
        if wanted:
            self._out = {
                name: transport.publish(f"/{NODE}/{name}", kind) for name, kind in _TOPICS.items()
            }

    def seen(self, watched: WatchedFrame) -> SeenImage | None:
        """Copy an image, in the thread that tracks; None if it is not wanted."""
        now = time.monotonic()
        if not self._wanted or now < self._due:
            return None
        self._due = now + self._period
        return SeenImage(
            _in_bgr(watched.image, rgb=self._rgb),
            watched.pixels().copy(),
            watched.features().inliers.copy(),
        )

    def publish(self, seen: SeenImage, stamp: int) -> None:
        """Publish a copy."""
        head = Heading(stamp, self._frame)
        quality = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
        content = cv2.imencode(".jpg", seen.image, quality)[1].tobytes()
        height, width = seen.image.shape[:2]
        colours = np.where(seen.matched[:, None], MAPPED, UNMATCHED).astype(np.float64) / 255
        D = self._camera.distortion[:5] if not self._camera.is_fisheye else np.zeros(5)
        made = {
            "camera_info": messages.camera_info(
                head, (width, height), np.asarray(self._camera.matrix, np.float64), _five(D)
            ),
            "image": messages.jpeg(head, content),
            "keypoints": messages.image_points(head, np.asarray(seen.pixels, np.float64), colours),
        }
        for name, message in made.items():
            self._out[name].send(to_cdr(message), stamp)


def _five(D: npt.ArrayLike) -> FloatArray:
    five = np.zeros(5)
    given = np.asarray(D, np.float64).reshape(-1)[:5]
    five[: len(given)] = given
    return five


def _in_bgr(image: ByteArray, *, rgb: bool) -> ByteArray:
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return np.array(image.reshape(image.shape[:2]))
    if channels == 4:
        image = image[:, :, :3]
    return np.array(image[:, :, ::-1] if rgb else image)
