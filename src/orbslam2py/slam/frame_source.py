# SPDX-License-Identifier: BSD-3-Clause
"""Input that a system can track: any object that gives images and time stamps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from orbslam2py._arguments import shown
from orbslam2py.errors import DatasetError, ImageError, StateError
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.front_end import PairMask

_Array = TypeVar("_Array", npt.NDArray[np.uint8], npt.NDArray[np.generic])


class SomeImages(Protocol):
    """The images of one moment; see `orbslam2py.datasets.Images`."""

    @property
    def image(self) -> npt.NDArray[np.uint8]: ...  # noqa: D102
    @property
    def right(self) -> npt.NDArray[np.uint8] | None: ...  # noqa: D102
    @property
    def depth(self) -> npt.NDArray[np.generic] | None: ...  # noqa: D102
    @property
    def mask(self) -> npt.NDArray[np.uint8] | None: ...  # noqa: D102


class SomeFrame(Protocol):
    """Images with their time; see `orbslam2py.datasets.Frame` and ``LiveFrame``."""

    @property
    def timestamp(self) -> float: ...  # noqa: D102
    @property
    def images(self) -> SomeImages: ...  # noqa: D102


class Recording(Protocol):
    """Images by their number; see `orbslam2py.datasets.Sequence`."""

    @property
    def timestamps(self) -> npt.NDArray[np.float64]: ...  # noqa: D102
    def load(self, index: int, /) -> SomeImages: ...  # noqa: D102


class TimedImages(NamedTuple):
    """Images with their time [s], and the samples of the IMU since the images before."""

    timestamp: float
    images: SomeImages
    imu: Any = None


#: A sequence, or any iterable of frames: a camera, a generator, a part of a sequence.
FrameSource = Recording | Iterable[SomeFrame]


def timed_images(
    source: FrameSource, sensor: Sensor, *, with_imu: bool = False
) -> Iterator[TimedImages]:
    """Yield images and time stamps.

    Parameters
    ----------
    source
        The source of the images.
    sensor
        Sensor for which the images are used.
    with_imu
        Also take the samples of the frames' ``imu``, if they have it.

    Raises
    ------
    StateError
        If the source was opened for another sensor, or gives an object that is no frame.
    DatasetError
        If an object should be an image but is none.
    """
    is_recording = hasattr(source, "timestamps") and hasattr(source, "load")
    if not is_recording and (not isinstance(source, Iterable) or isinstance(source, str | bytes)):
        raise StateError(
            f"the images come from {shown(source)}; give a sequence, as open_sequence returns, or "
            "anything that yields frames with a timestamp and images"
        )
    opened_for: Any = getattr(source, "sensor", sensor)
    if opened_for != sensor:
        raise StateError(
            f"the sequence gives images for sensor '{opened_for}', but this system is for "
            f'\'{sensor}\'; open it with "{sensor}", or make the system for "{opened_for}"'
        )
    if isinstance(source, Iterable):
        for frame in source:
            if not (hasattr(frame, "timestamp") and hasattr(frame, "images")):
                raise StateError(
                    f"a frame is {shown(frame)}; it must have a timestamp and images, as those of "
                    "orbslam2py.datasets.Frame"
                )
            check_images(frame.images, "a frame")
            samples = getattr(frame, "imu", None) if with_imu else None
            yield TimedImages(frame.timestamp, frame.images, samples)
    else:
        for index, timestamp in enumerate(source.timestamps.tolist()):
            images = source.load(index)
            check_images(images, f"load({index})")
            yield TimedImages(timestamp, images)


def check_images(images: object, giver: str) -> None:
    """Check that an object has the fields of `orbslam2py.datasets.Images` for a single camera.

    Parameters
    ----------
    images
        The given object.
    giver
        Name of its source, for the message.

    Raises
    ------
    DatasetError
        If it has not.
    """
    if not (hasattr(images, "image") and hasattr(images, "mask")):
        raise DatasetError(
            f"{giver} gave {shown(images)} for images; give "
            "orbslam2py.datasets.Images(image, right=..., depth=..., mask=...)"
        )


def arrays_of(
    images: SomeImages | npt.NDArray[np.uint8] | Sequence[Any],
    sensor: Sensor,
    timestamp: float,
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[Any] | None, PairMask | None]:
    """Return the arrays that a sensor needs from the images of one moment.

    Returns
    -------
    first, second, mask
        The image; the right image or the depth, None for a single camera; the mask of the images.

    Raises
    ------
    ImageError
        If an image that the sensor needs is missing, or there is one too many.
    """
    if hasattr(images, "image"):
        some: Any = images
        mask = getattr(some, "mask", None)
        if sensor is Sensor.RIG:
            cameras = _present(getattr(some, "cameras", None), "images of all cameras", timestamp)
            return some.image, cameras, None
        if sensor is Sensor.MONOCULAR:
            return some.image, None, mask
        if sensor is Sensor.RGBD:
            return (
                some.image,
                _present(getattr(some, "depth", None), "depth image", timestamp),
                mask,
            )
        right = _present(getattr(some, "right", None), "right image", timestamp)
        # The mask is the left image's; keypoints hidden by it need no partner.
        return some.image, right, None if mask is None else (mask, None)
    if sensor is Sensor.RIG:
        if not isinstance(images, tuple | list):
            raise ImageError(
                f"the frame of {timestamp} s has one image; sensor 'rig' needs a sequence with one "
                "for each camera, None for a camera that gave none"
            )
        first: Any = next((one for one in images if one is not None), None)
        rest: Any = images
        return first, rest, None
    several: Any = images if isinstance(images, tuple | list) else (images,)
    wanted = 1 if sensor is Sensor.MONOCULAR else 2
    if len(several) != wanted:
        needs = {
            Sensor.MONOCULAR: "one image",
            Sensor.STEREO: "the left and the right image",
            Sensor.RGBD: "an image and its depth",
        }[sensor]
        raise ImageError(
            f"the frame of {timestamp} s has {len(several)} images; sensor '{sensor}' needs {needs}"
        )
    return several[0], several[1] if wanted == 2 else None, None


def _present(array: _Array | None, what: str, timestamp: float) -> _Array:
    if array is None:
        raise ImageError(f"the frame of {timestamp:.6f} s has no {what}, which this sensor needs")
    return array
