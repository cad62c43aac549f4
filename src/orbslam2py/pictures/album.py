# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of keyframes, stored on disk, because a long run has thousands."""

from __future__ import annotations

import logging
import tempfile
from dataclasses import dataclass

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray
from orbslam2py._files import reason_of

_log = logging.getLogger(__name__)

_JPEG_QUALITY = 80


@dataclass(frozen=True)
class KeyframePicture:
    """The view of a keyframe."""

    image: ByteArray
    """(h, w, 3) red, green, blue, keypoints marked."""
    n_keypoints: int
    n_matched: int
    """Number of keypoints with a match in the map, at the time of the image."""


@dataclass(frozen=True)
class _Place:
    offset: int
    size: int
    n_keypoints: int
    n_matched: int


class Album:
    """Pictures by keyframe, in a temporary file without a name."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="orbslam2py-")  # noqa: SIM115  # see close
        self._places: dict[int, _Place] = {}
        self._end = 0
        self._full = False

    def add(self, keyframe: int, picture: KeyframePicture) -> None:
        """Store the picture of a keyframe; once the disk is full, no more are stored."""
        if self._full:
            return
        bgr = np.ascontiguousarray(picture.image[:, :, ::-1])
        done, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        if not done:
            return
        data = encoded.tobytes()
        try:
            self._file.seek(self._end)
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            self._full = True
            _log.warning(
                "the viewer keeps no more images of keyframes: %s in %s",
                reason_of(error).lower(),
                tempfile.gettempdir(),
            )
            return
        self._places[keyframe] = _Place(
            self._end, len(data), picture.n_keypoints, picture.n_matched
        )
        self._end += len(data)

    def find(self, keyframe: int) -> KeyframePicture | None:
        """Return the picture of a keyframe, if there is one."""
        place = self._places.get(keyframe)
        if place is None:
            return None
        self._file.seek(place.offset)
        data = np.frombuffer(self._file.read(place.size), np.uint8)
        decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
        if decoded is None:
            return None
        image = np.asarray(decoded[:, :, ::-1], np.uint8)
        return KeyframePicture(image, place.n_keypoints, place.n_matched)

    def clear(self) -> None:
        """Drop all pictures: another map has begun."""
        self._places = {}
        self._end = 0

    def close(self) -> None:
        """Remove the file."""
        self._file.close()
