# SPDX-License-Identifier: BSD-3-Clause
"""Interface of all data sets, for any layout on disk."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray, EqualByValue, FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.trajectory import Trajectory

_log = logging.getLogger(__name__)


class Layout(str, Enum):
    """The layout of a recorded sequence on disk."""

    TUM = "tum"
    KITTI = "kitti"
    EUROC = "euroc"
    ROSBAG1 = "rosbag1"
    ROSBAG2 = "rosbag2"
    MCAP = "mcap"
    ICL_NUIM = "icl-nuim"
    SEVEN_SCENES = "7-scenes"
    BONN = "bonn"
    REPLICA = "replica"
    OPENLORIS = "openloris"
    KITTI_RAW = "kitti-raw"

    @classmethod
    def _missing_(cls, value: object) -> Layout:
        raise DatasetError(f"no layout {value!r}; there are: {', '.join(map(str, cls))}")

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, eq=False)
class Images(EqualByValue):
    """The images of one moment, as the tracking calls take them; equal if all pixels are equal.

    Attributes
    ----------
    image
        Image of the single, left or colour camera: uint8 (h, w), (h, w, 3) or (h, w, 4) with the
        colour order of the settings.
    right
        Right image of a rectified pair (stereo), else None.
    depth
        Raw depth registered to `image`, single channel (h, w) (RGB-D), else None.
    mask
        uint8 (h, w): no keypoints in `image` where the mask is 0. None: anywhere.
    cameras
        Of a rig one entry for each camera: its image; image and depth of a camera with depth
        images; None if it has none at that moment. `image` is that of the first camera that has
        one. Of other sensors None.
    """

    image: ByteArray
    right: ByteArray | None = None
    depth: NDArray[np.generic] | None = None
    mask: ByteArray | None = None
    cameras: tuple[Any, ...] | None = None


@dataclass(frozen=True)
class Frame:
    """A frame of a sequence, as a loop over the sequence yields it.

    Attributes
    ----------
    index
        Number in the sequence, from 0.
    timestamp
        Seconds.
    text
        The time stamp in decimal seconds, with all digits of the source.
    images
        Images of the frame, in the form of the tracking calls.
    read_imu
        Reads the samples for `imu`; None without an IMU.
    """

    index: int
    timestamp: float
    text: str
    images: Images
    read_imu: Callable[[], FloatArray | None] | None = field(
        default=None, repr=False, compare=False
    )

    @cached_property
    def imu(self) -> FloatArray | None:
        """Samples of the IMU since the frame before, float64 (n, 7); None without an IMU.

        Rows as `ImuSamples` has them, up to the first one that is not before the frame. The
        recording is read when they are asked for.

        Raises
        ------
        DatasetError
            If the samples of the recording cannot be read.
        """
        return None if self.read_imu is None else self.read_imu()


class Source(Protocol):
    """A source of images, opened for one sensor.

    Attributes
    ----------
    name
        Name of the folder, the file, the camera or the world.
    layout
        Layout on disk, or ``camera``.
    sensor
        The sensor.
    settings
        The settings given by the caller, or chosen by the files beside the images.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def layout(self) -> str: ...  # noqa: D102
    @property
    def sensor(self) -> Sensor: ...  # noqa: D102
    @property
    def settings(self) -> Settings: ...  # noqa: D102

    def ground_truth(self) -> Trajectory | None:
        """Return the true poses ``T_wc`` of the single, left (rectified) or colour camera.

        Returns
        -------
        Trajectory or None
            None if there are none.

        Raises
        ------
        DatasetError
            If there is a file but it is malformed.
        """
        ...


@dataclass(frozen=True)
class FrameTimes:
    """When a live frame passed its stages, seconds on the clock of ``time.monotonic()``.

    Attributes
    ----------
    exposure
        Middle of the exposure of the (left) image; None if the device does not give it.
    arrival
        The first image of the frame came.
    complete
        The last image of the frame came.
    taken
        The reader took the frame from the queue.
    ready
        The images were rectified and converted.
    """

    exposure: float | None
    arrival: float
    complete: float
    taken: float
    ready: float


@dataclass(frozen=True, eq=False)
class LiveFrame(EqualByValue):
    """An image from a camera.

    Attributes
    ----------
    timestamp
        Seconds since 1970 of the (left) image; grows from frame to frame, for any behaviour of the
        clocks.
    text
        The time stamp in decimal seconds.
    images
        The image, with its mask if there is one.
    imu
        Samples of the IMU since the frame before, up to the time of this one: rows
        ``[t, gx, gy, gz, ax, ay, az]``, float64 (n, 7), seconds on the clock of `timestamp`,
        rad/s, m/s^2. None if the source has no IMU.
    stamp
        Time of the (left) image on the clock of the device, seconds; None if it has no clock.
    times
        When the frame passed its stages, for the latency; None if the source does not give it.
    """

    timestamp: float
    text: str
    images: Images
    imu: FloatArray | None = None
    stamp: float | None = None
    times: FrameTimes | None = None


class LiveSource(Source, Protocol):
    """Images without a known end, as long as it is entered as a context; see `Source`.

    Attributes
    ----------
    n_dropped
        Number of frames that were lost so far because they were not read in time.
    """

    @property
    def n_dropped(self) -> int: ...  # noqa: D102

    def open(self) -> None:
        """Open the camera; entering the context does it if this did not.

        Raises
        ------
        DatasetError
            If it cannot be opened, with the cameras there are.
        """
        ...

    def __enter__(self) -> LiveSource: ...
    def __exit__(self, *_: object) -> None: ...

    def __iter__(self) -> Iterator[LiveFrame]:
        """Yield the newest image again and again; see `take`."""
        ...

    def take(self, timeout: float, /) -> LiveFrame | None:
        """Take the newest image that was not taken yet, or wait for one.

        Parameters
        ----------
        timeout
            Seconds to wait at most.

        Returns
        -------
        LiveFrame or None
            None if none came in that time.

        Raises
        ------
        DatasetError
            If no more images come.
        """
        ...


class Sequence(Source, Protocol):
    """A sequence of known length, recorded or made up; see `Source`.

    The ``index`` of a frame is its number in the sequence, from 0, also if a run skips frames.

    Attributes
    ----------
    timestamps
        Time of every frame in seconds, float64 (n,). The arrays of this package's sequences are
        read-only: ``sequence.timestamps - sequence.timestamps[0]`` makes a new array.
    """

    @property
    def timestamps(self) -> FloatArray: ...  # noqa: D102

    def __len__(self) -> int:
        """Return the number of frames."""
        ...

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds, with all digits of the source.

        Parameters
        ----------
        index
            Number of the frame in the sequence, from 0.
        """
        ...

    def default_settings(self) -> Settings:
        """Choose settings by the files beside the images.

        Raises
        ------
        DatasetError
            If there are none, with a list of remedies.
        SettingsError
            If a settings file beside the images is invalid.
        """
        ...

    def load(self, index: int, /) -> Images:
        """Read (and rectify) the images of a frame.

        Parameters
        ----------
        index
            Number of the frame in the sequence, from 0.

        Raises
        ------
        DatasetError
            If a file is missing, or the index is no whole number.
        ImageError
            If a file is no readable image of the right type.
        IndexError
            If there is no such frame.
        """
        ...


class IterableSequence(Sequence, Protocol):
    """A `Sequence` that can be iterated, by `FramesInOrder`."""

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames one after the other, from the first."""
        ...


@dataclass(frozen=True, eq=False)
class Stamps:
    """Time stamps of a list file.

    Attributes
    ----------
    seconds
        float64 (n,); a copy of what was given, and read-only.
    texts
        The same as text in seconds, all digits of the source kept.
    lines
        Line number of each in the file, from 1.
    doubts
        Changes and doubts, one sentence each.
    """

    seconds: FloatArray
    texts: tuple[str, ...]
    lines: tuple[int, ...]
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        seconds = np.array(self.seconds, dtype=np.float64)
        seconds.setflags(write=False)  # sequences hand it out
        object.__setattr__(self, "seconds", seconds)


def rate_of(seconds: FloatArray, usual: float) -> float:
    """Return images per second by the usual step, or `usual` if no time increases."""
    steps = np.diff(seconds)
    steps = steps[steps > 0]
    # Rounded, since times are written with few digits: 9.99999 would count as 9 frames.
    return round(1.0 / float(np.median(steps)), 3) if len(steps) else usual


def choose_sensor(
    folder: Path, wanted: Sensor | str | None, available: tuple[Sensor, ...]
) -> Sensor:
    """Return the requested sensor, or the richest available one.

    Parameters
    ----------
    folder
        Folder of the images, for the message.
    wanted
        None for the richest.
    available
        Sensors that there are images for, the richest first.

    Raises
    ------
    DatasetError
        If the sequence has no images for it.
    """
    if wanted is None:
        return available[0]
    wanted = Sensor(wanted)
    if wanted not in available:
        names = ", ".join(str(sensor) for sensor in available)
        raise DatasetError(f"{folder} has no {wanted} images; it can be used as: {names}")
    return wanted


def require_frames(source: Path, count: int) -> None:
    """Raise `DatasetError` if a list names no images."""
    if count == 0:
        raise DatasetError(f"no images: {source} lists none")
