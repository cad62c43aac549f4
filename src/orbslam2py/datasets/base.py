# SPDX-License-Identifier: BSD-3-Clause
"""What every data set offers, whatever its layout on disk."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray, EqualByValue, FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.trajectory import Trajectory

_log = logging.getLogger(__name__)


class Layout(str, Enum):
    """How a recorded sequence lies on disk."""

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
    """The images of one moment, as the tracking calls take them; equal if all pixels are.

    Attributes
    ----------
    image
        Image of the only, left or colour camera: uint8 (h, w), (h, w, 3) or (h, w, 4) with the
        colour order that the settings declare.
    right
        Right image of a rectified pair (stereo), else None.
    depth
        Raw depth registered to `image`, single channel (h, w) (RGB-D), else None.
    mask
        uint8 (h, w): no keypoint lies in `image` where it is 0. None: anywhere.
    """

    image: ByteArray
    right: ByteArray | None = None
    depth: NDArray[np.generic] | None = None
    mask: ByteArray | None = None


@dataclass(frozen=True)
class Frame:
    """A frame of a sequence, as a loop over the sequence gives it.

    Attributes
    ----------
    index
        Place in the sequence, from 0.
    timestamp
        Seconds.
    text
        The time stamp in decimal seconds, with all digits of the source.
    images
        What the camera saw, as the tracking calls take it.
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
    """Where images come from, opened for one sensor.

    Attributes
    ----------
    name
        Name of the folder, the file, the camera or the world.
    layout
        How it lies on disk, or ``camera``.
    sensor
        What it delivers images for.
    settings
        Given by the caller, or chosen by what comes with the images.
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
        """Return the true poses ``T_wc`` of the only, left (rectified) or colour camera.

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
class LiveFrame:
    """An image from a camera.

    Attributes
    ----------
    timestamp
        Seconds since 1970 when it came; grows from image to image whatever the system's clock does.
    text
        The time stamp in decimal seconds.
    images
        The image, with its mask if there is one.
    imu
        Samples of an IMU since the frame before, float64 (n, 7), as `ImuSamples` has them; None
        without an IMU.
    """

    timestamp: float
    text: str
    images: Images
    imu: FloatArray | None = None


class LiveSource(Source, Protocol):
    """Images without a known end, as long as it is entered as a context; see `Source`.

    Attributes
    ----------
    n_dropped
        Images so far that came while nobody had taken the one before, which was then lost.
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

    The ``index`` of a frame is its place in the sequence, from 0, whichever frames a run takes.

    Attributes
    ----------
    timestamps
        Time of every frame in seconds, float64 (n,). Those of this package's sequences are
        read-only: ``sequence.timestamps - sequence.timestamps[0]`` makes an array of one's own.
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
            Place of the frame in the sequence, from 0.
        """
        ...

    def default_settings(self) -> Settings:
        """Choose settings by what comes with the images.

        Raises
        ------
        DatasetError
            If nothing tells them, listing what can be done.
        SettingsError
            If a settings file that comes with the images is wrong.
        """
        ...

    def load(self, index: int, /) -> Images:
        """Read (and rectify) the images of a frame.

        Parameters
        ----------
        index
            Place of the frame in the sequence, from 0.

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
    """A `Sequence` with a loop over its frames, which `FramesInOrder` has ready."""

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
        What was changed in them, or may be wrong, one sentence each.
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
    """Return images per second by the usual step, or `usual` if no time grows."""
    steps = np.diff(seconds)
    steps = steps[steps > 0]
    # Rounded, since times are written with few digits: 9.99999 would count as 9 frames.
    return round(1.0 / float(np.median(steps)), 3) if len(steps) else usual


def choose_sensor(
    folder: Path, wanted: Sensor | str | None, available: tuple[Sensor, ...]
) -> Sensor:
    """Return the wanted sensor, or the richest available one.

    Parameters
    ----------
    folder
        Where the images are, for the message.
    wanted
        None for the richest.
    available
        Sensors there are images for, the richest first.

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
