# SPDX-License-Identifier: BSD-3-Clause
"""The seam between a device and the mechanism that all live sources share.

A device delivers images and samples of an IMU to a `Sink`, each as soon as it comes, from threads
of its own. It does nothing else: `orbslam2py.live.stream.LiveStream` pairs the images, keeps the
queue, joins gyro and accelerometer, watches the clock and the rate, and starts a lost device again.

A new kind of device is a class with the members of `Device` and one entry in
`orbslam2py.live.registry.KINDS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.settings import ImuSettings, Sensor, Settings

#: Streams of a device: images of one camera; the left and the right image of a pair; depth
#: registered to `image`; samples of an IMU.
Stream = Literal["image", "left", "right", "depth", "imu"]


class Sink(Protocol):
    """Where a device delivers to. No call blocks. Calls may come from any thread."""

    def image(
        self,
        stream: Stream,
        array: NDArray[Any],
        stamp: float,
        /,
        exposure: float | None = None,
    ) -> None:
        """Deliver an image.

        Parameters
        ----------
        stream
            ``image``, ``left``, ``right`` or ``depth``.
        array
            Grey (h, w) or colour in the order BGR (h, w, 3), uint8 or uint16; depth (h, w), uint16
            or float32. The sink keeps the array: pass an array that is not written to any more. Raw
            images of a pair are rectified later, if the settings say how.
        stamp
            Time of the image on the clock of the device, seconds. All streams of a device, the IMU
            too, share one clock. Its zero does not matter.
        exposure
            Middle of the exposure on the clock of ``time.monotonic()``, seconds, for the latency;
            None if it is not known: the time of this call is taken.
        """
        ...

    def imu(self, samples: FloatArray, /) -> None:
        """Deliver samples of an IMU.

        Parameters
        ----------
        samples
            Rows ``[t, gx, gy, gz, ax, ay, az]``, float64 (n, 7): seconds on the clock of the
            images, angular rate [rad/s], specific force [m/s^2], in the frame of the IMU.
        """
        ...

    def gyro(self, samples: FloatArray, /) -> None:
        """Deliver angular rates of a gyro that has its own sample times; see `accel`.

        Parameters
        ----------
        samples
            Rows ``[t, gx, gy, gz]``, float64 (n, 4).
        """
        ...

    def accel(self, samples: FloatArray, /) -> None:
        """Deliver specific forces, which are interpolated at the times of the gyro.

        Parameters
        ----------
        samples
            Rows ``[t, ax, ay, az]``, float64 (n, 4).
        """
        ...

    def fault(self, text: str, /) -> None:
        """Report that the device is lost: the end of a sentence that begins with its name.

        The mechanism reports it, stops the device and starts it again until it answers.
        """
        ...

    def warning(self, text: str, /) -> None:
        """Report something to the user: the end of a sentence that begins with the device's name.

        Equal texts are logged once, and counted.
        """
        ...


class Device(Protocol):
    """A camera, an IMU, or the topics of a robot.

    Attributes
    ----------
    name
        Name for messages and results, as the user gave it where he gave one: ``realsense:1234``.
    kind
        Prefix of the source, the layout of its frames: ``realsense``.
    streams
        The streams that it will deliver. Images of a frame are complete when each of these has
        come.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def kind(self) -> str: ...  # noqa: D102
    @property
    def streams(self) -> tuple[Stream, ...]: ...  # noqa: D102

    def settings(self) -> Settings | None:
        """Read the calibration of the device, for the sensor of the request it was made for.

        Called once, before `start`. May open the device, and wait some seconds for an answer.

        Returns
        -------
        Settings or None
            None if the device has no calibration: the user must give settings then.

        Raises
        ------
        DatasetError
            If the device is not there, is in use, or may not be used, with the remedy.
        """
        ...

    def imu_settings(self) -> ImuSettings | None:
        """Read noise and place of the IMU, as `settings`; None if they are not known."""
        ...

    def start(self, sink: Sink, /) -> None:
        """Begin to deliver; again after `stop`, with the same sink, when the device was lost.

        Raises
        ------
        DatasetError
            If the device is not there, is in use, or may not be used, with the remedy.
        """
        ...

    def stop(self) -> None:
        """End delivering and free the device; nothing is delivered after the return.

        Safe to call at any time, and more than once.
        """
        ...


@dataclass(frozen=True)
class Request:
    """Request of a user to a kind of device.

    Attributes
    ----------
    address
        The part after the prefix of the source, such as a serial number; empty for the first
        device. Of ``rtsp://host/path`` all of it.
    sensor
        Sensor for which the images are used; None for the richest that the device can do.
    imu
        Whether samples of the IMU are wanted.
    fps
        Images per second; None lets the device decide.
    size
        Width and height of the images in pixels; None lets the device decide.
    split
        Whether every image holds two views side by side.
    topics
        Topics by their role, as ``--topics`` gives them.
    """

    address: str = ""
    sensor: Sensor | None = None
    imu: bool = False
    fps: float | None = None
    size: tuple[int, int] | None = None
    split: bool = False
    topics: Mapping[str, str] | str | None = None


@dataclass(frozen=True)
class FoundDevice:
    """A device that is plugged in, for ``orbslam2py devices``.

    Attributes
    ----------
    source
        What `orbslam2py run` takes: ``realsense:1234``.
    description
        Name of the product.
    modes
        Modes that it can deliver, a line each: ``infrared 848 x 480, 30 fps``.
    """

    source: str
    description: str
    modes: tuple[str, ...] = ()
