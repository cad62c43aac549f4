# SPDX-License-Identifier: BSD-3-Clause
"""Images of a camera cannot be read again; some are kept in small size during the run."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.records import TrackingRecord, TrackingState

#: Most keyframes that are kept; of more, every other one is.
_MOST = 64
#: Most frames in which tracking was lost.
_MOST_LOST = 8
#: Of the images [px].
WIDTH = 480
#: They are written a second time, with points in them.
_QUALITY = 92


@dataclass(frozen=True, eq=False)
class SmallImage:
    """A small image for the report page."""

    picture: npt.NDArray[np.uint8]
    """(h, w, 3) blue, green, red."""
    scale: float
    """Its pixels per pixel of the image."""


def shrink(image: ByteArray, *, rgb: bool) -> SmallImage:
    """Make an image small.

    Parameters
    ----------
    image
        uint8 (h, w), (h, w, 3) or (h, w, 4), as from a sequence.
    rgb
        The order of its colours.
    """
    height, width = image.shape[:2]
    scale = min(1.0, WIDTH / width)
    size = (max(1, round(scale * width)), max(1, round(scale * height)))
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    return SmallImage(_as_bgr(small, rgb=rgb), scale)


def _as_bgr(image: ByteArray, *, rgb: bool) -> npt.NDArray[np.uint8]:
    if image.ndim == 2:
        return np.repeat(image[:, :, None], 3, axis=2)
    three = image[:, :, 2::-1] if rgb else image[:, :, :3]
    return np.ascontiguousarray(three)


class KeptImages:
    """Keeps images of keyframes, evenly distributed over a run, and of the first losses.

    Parameters
    ----------
    settings : Settings
        The camera, for the order of colours.
    """

    def __init__(self, settings: Settings) -> None:
        self._rgb = settings.camera.rgb
        self._keyframes: dict[int, tuple[bytes, float]] = {}
        self._lost: dict[int, tuple[bytes, float]] = {}
        self._every = 1
        self._n_keyframes = 0
        self._was_tracked = False

    def look(self, position: int, image: ByteArray, record: TrackingRecord) -> None:
        """Keep the image of a frame, if it is one of these.

        Parameters
        ----------
        position : int
            Position of the frame in `RunResult.rows`.
        image : array of uint8, (h, w) or (h, w, 3) or (h, w, 4)
            The image from the camera.
        record : TrackingRecord
            Result of the frame.
        """
        is_lost = record.state is TrackingState.LOST
        if is_lost and self._was_tracked and len(self._lost) < _MOST_LOST:
            self._lost[position] = self._encoded(image)
        self._was_tracked = record.state is TrackingState.OK
        if not record.is_keyframe:
            return
        if self._n_keyframes % self._every == 0:
            self._keyframes[position] = self._encoded(image)
            if len(self._keyframes) > _MOST:
                self._keyframes = dict(list(self._keyframes.items())[::2])
                self._every *= 2
        self._n_keyframes += 1

    @property
    def positions(self) -> list[int]:
        """Positions of the frames with images, ascending."""
        return sorted({*self._keyframes, *self._lost})

    def find(self, position: int) -> SmallImage | None:
        """The image of a frame, if it was kept."""
        found = self._keyframes.get(position) or self._lost.get(position)
        if found is None:
            return None
        picture = cv2.imdecode(np.frombuffer(found[0], np.uint8), cv2.IMREAD_COLOR)
        return None if picture is None else SmallImage(np.asarray(picture, np.uint8), found[1])

    def _encoded(self, image: ByteArray) -> tuple[bytes, float]:
        small = shrink(image, rgb=self._rgb)
        done, jpeg = cv2.imencode(".jpg", small.picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        assert done
        return jpeg.tobytes(), small.scale
