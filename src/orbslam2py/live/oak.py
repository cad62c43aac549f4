# SPDX-License-Identifier: BSD-3-Clause
"""OAK cameras, by Luxonis' depthai: raw pair, colour with depth, and IMU."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property
from typing import Any

import numpy as np

from orbslam2py.errors import DatasetError
from orbslam2py.live.device import FoundDevice, Request, Sink, Stream
from orbslam2py.live.oak_calibration import (
    COLOUR,
    LEFT,
    RIGHT,
    dai,
    imu_settings_of,
    settings_of,
)
from orbslam2py.live.usb import find_usb
from orbslam2py.settings import ImuSettings, Sensor, Settings

#: Default size and rate: all OAK-D cameras have them.
_SIZE, _RATE = (640, 400), 30.0
#: Samples of the IMU per second, and how many come together at most.
_IMU_RATE, _IMU_BATCH = 200, 10
#: Longest wait for a message before looking whether to stop.
_LOOK = timedelta(seconds=0.2)
#: Times of exposure are older than the present by no more than this, seconds.
_OLDEST = 10.0
#: Messages that wait in a queue of the library.
_ROOM = 8
_VENDOR = ("03e7",)
_RULE = (
    'you may not use it: write the udev rule SUBSYSTEM=="usb", ATTRS{idVendor}=="03e7", '
    'MODE="0666" into /etc/udev/rules.d/80-movidius.rules, then \'sudo udevadm control '
    "--reload-rules && sudo udevadm trigger', and plug it in again"
)


@dataclass
class Opened:
    """A pipeline of the library that is ready to start.

    Attributes
    ----------
    pipeline
        ``depthai.Pipeline``.
    images
        Outputs by stream.
    imu
        Output of the IMU; None without.
    """

    pipeline: Any
    images: dict[Stream, Any]
    imu: Any = None


class Oak:
    """An OAK camera; see `device.Device`.

    Parameters
    ----------
    name
        Name for messages.
    kind_of_images
        Sensor for which the images are used.
    request
        Size, rate, and whether the IMU is wanted.
    make
        Makes a new pipeline at each call.
    read_calibration
        Returns the ``depthai.CalibrationHandler`` of the camera.
    """

    kind = "oak"

    def __init__(
        self,
        name: str,
        kind_of_images: Sensor,
        request: Request,
        make: Callable[[], Opened],
        read_calibration: Callable[[], Any],
    ) -> None:
        self.name = name
        self._images_for = kind_of_images
        self._request = request
        self._make = make
        self._read_calibration = read_calibration
        self._opened: Opened | None = None
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []

    @property
    def streams(self) -> tuple[Stream, ...]:
        """The streams that it will deliver."""
        streams: dict[Sensor, tuple[Stream, ...]] = {
            Sensor.STEREO: ("left", "right"),
            Sensor.RGBD: ("image", "depth"),
            Sensor.MONOCULAR: ("image",),
        }
        images = streams[self._images_for]
        return (*images, "imu") if self._request.imu else images

    @cached_property
    def _calibration(self) -> Any:
        return self._read_calibration()

    def settings(self) -> Settings | None:
        """Make settings of the factory calibration; see `device.Device.settings`."""
        size, fps = self._request.size or _SIZE, self._request.fps or _RATE
        return settings_of(self._calibration, self.name, self._images_for, size, fps)

    def imu_settings(self) -> ImuSettings | None:
        """Return place and usual noise of the IMU."""
        return imu_settings_of(self._calibration, self._images_for, _IMU_RATE)

    def start(self, sink: Sink, /) -> None:
        """Make and start the pipeline; see `device.Device.start`."""
        self._stop = stop = threading.Event()
        try:
            self._opened = opened = self._make()
            readers = [
                (output.createOutputQueue(_ROOM, False), _image_reader(sink, stream))
                for stream, output in opened.images.items()
            ]
            if opened.imu is not None:
                queue = opened.imu.createOutputQueue(_ROOM * _IMU_BATCH, False)
                readers.append((queue, _imu_reader(sink)))
            opened.pipeline.start()
        except RuntimeError as error:
            self.stop()
            raise DatasetError(_problem(self.name, str(error))) from error
        # Threads, no callbacks: these would wait for the interpreter inside the library, which can
        # wait for the library at the same time.
        self._threads = [
            threading.Thread(target=_read, args=(*one, sink, stop), name="oak", daemon=True)
            for one in readers
        ]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop the pipeline and free the camera; see `device.Device.stop`."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self._threads = []
        opened, self._opened = self._opened, None
        if opened is not None:
            opened.pipeline.stop()


def _read(queue: Any, take: Callable[[Any], None], sink: Sink, stop: threading.Event) -> None:
    """Take the messages of a queue until it is closed, which it is when the camera is lost."""
    try:
        while not stop.is_set():
            message = queue.get(_LOOK)
            if message is not None and not stop.is_set():
                take(message)
    except (RuntimeError, dai.MessageQueue.QueueException) as error:
        if not stop.is_set():
            sink.fault(f"ended ({error}); was it unplugged?")


def _image_reader(sink: Sink, stream: Stream) -> Callable[[Any], None]:
    middle = dai.CameraExposureOffset.MIDDLE

    def take(message: Any) -> None:
        # Both at the middle of the exposure: on the clock of the camera, and on the steady clock of
        # this computer, which is that of time.monotonic().
        stamp = message.getTimestampDevice(middle).total_seconds()
        exposure = message.getTimestamp(middle).total_seconds()
        plausible = exposure if 0 <= time.monotonic() - exposure < _OLDEST else None
        pixels = message.getFrame() if stream == "depth" else message.getCvFrame()
        sink.image(stream, np.array(pixels), stamp, exposure=plausible)

    return take


def _imu_reader(sink: Sink) -> Callable[[Any], None]:
    def take(message: Any) -> None:
        sink.accel(np.array(list(_rows(message.packets, "acceleroMeter"))))
        sink.gyro(np.array(list(_rows(message.packets, "gyroscope"))))

    return take


def _rows(packets: Any, name: str) -> Iterator[list[float]]:
    for packet in packets:
        report = getattr(packet, name)
        stamp = report.getTimestampDevice().total_seconds()
        yield [stamp, report.x, report.y, report.z]


# ---- the pipeline of a camera --------------------------------------------------------------------
def open_device(request: Request) -> Oak:
    """Make the device of ``oak:`` or ``oak:ID``, not started.

    Raises
    ------
    DatasetError
        If there is no such camera.
    """
    name = f"oak:{request.address}"
    kind = request.sensor or Sensor.STEREO
    _information(name, request.address)

    def make() -> Opened:
        device = _connected(name, request.address)
        return camera_pipeline(dai.Pipeline(device), device, kind, request)

    def calibration() -> Any:
        return _connected(name, request.address).readCalibration()

    return Oak(name, kind, request, make, calibration)


def camera_pipeline(pipeline: Any, device: Any, kind: Sensor, request: Request) -> Opened:
    """Put the nodes of a camera into a pipeline.

    Parameters
    ----------
    pipeline, device
        Those of the library.
    kind
        Sensor for which the images are used.
    request
        Size, rate, and whether the IMU is wanted.
    """
    size, fps = request.size or _SIZE, request.fps or _RATE
    grey = dai.ImgFrame.Type.GRAY8

    def camera(socket: Any) -> Any:
        return pipeline.create(dai.node.Camera).build(socket, sensorFps=fps)

    images: dict[Stream, Any]
    if kind is Sensor.STEREO:
        images = {
            "left": camera(LEFT).requestOutput(size, grey, fps=fps),
            "right": camera(RIGHT).requestOutput(size, grey, fps=fps),
        }
    elif kind is Sensor.MONOCULAR:
        images = {"image": camera(LEFT).requestOutput(size, grey, fps=fps)}
    else:
        colour = camera(COLOUR).requestOutput(
            size, dai.ImgFrame.Type.BGR888i, fps=fps, enableUndistortion=True
        )
        stereo = pipeline.create(dai.node.StereoDepth)
        for socket, side in ((LEFT, stereo.left), (RIGHT, stereo.right)):
            camera(socket).requestOutput(_SIZE, fps=fps).link(side)
        images = {"image": colour, "depth": _aligned_depth(pipeline, device, stereo, colour)}
    if not request.imu:
        return Opened(pipeline, images)
    imu = pipeline.create(dai.node.IMU)
    sensors = [dai.IMUSensor.ACCELEROMETER_RAW, dai.IMUSensor.GYROSCOPE_RAW]
    imu.enableIMUSensor(sensors, _IMU_RATE)
    imu.setBatchReportThreshold(1)
    imu.setMaxBatchReports(_IMU_BATCH)
    return Opened(pipeline, images, imu.out)


def _aligned_depth(pipeline: Any, device: Any, stereo: Any, colour: Any) -> Any:
    """Return the output of depth at the pixels of colour; newer cameras have a node for it."""
    if device.getPlatform() == dai.Platform.RVC4:
        align = pipeline.create(dai.node.ImageAlign)
        stereo.depth.link(align.input)
        colour.link(align.inputAlignTo)
        return align.outputAligned
    colour.link(stereo.inputAlignTo)
    return stereo.depth


# ---- finding cameras -----------------------------------------------------------------------------
def find_devices() -> list[FoundDevice]:
    """List the cameras that are plugged in; modes are known only once a camera is started."""
    found = [
        FoundDevice(f"oak:{one.getDeviceId()}", f"{one.name} ({one.state.name.lower()})")
        for one in dai.Device.getAllAvailableDevices()
    ]
    if not found:
        found = [
            FoundDevice("oak:", f"{one.product} ({_RULE})")
            for one in find_usb(_VENDOR)
            if not one.is_allowed
        ]
    return found


def _information(name: str, address: str) -> Any:
    """Find the description of a camera."""
    there = list(dai.Device.getAllAvailableDevices())
    for one in there:
        if address in ("", one.getDeviceId(), one.name):
            return one
    if there:
        ids = ", ".join(f"oak:{one.getDeviceId()}" for one in there)
        raise DatasetError(f"{name} is not there; plugged in are: {ids}")
    for plugged in find_usb(_VENDOR):
        what = f"{name}: {plugged.product or 'an OAK camera'} is plugged in"
        if not plugged.is_allowed:
            raise DatasetError(f"{what}, but {_RULE}")
        raise DatasetError(
            f"{what}, but cannot be used; it may be in use by another program: close it"
        )
    raise DatasetError(
        f"{name} is not there: no OAK camera is plugged in or in the network; plug it into a USB 3 "
        "port; 'orbslam2py devices' lists connected cameras"
    )


def _connected(name: str, address: str) -> Any:
    try:
        return dai.Device(_information(name, address))
    except RuntimeError as error:
        raise DatasetError(_problem(name, str(error))) from error


def _problem(name: str, text: str) -> str:
    """Explain an error of the library to the user."""
    low = text.lower()
    if "already" in low or "in use" in low or "busy" in low:
        return f"{name} is in use by another program; close it ({text})"
    if "permission" in low or "udev" in low:
        return f"{name}: {_RULE} ({text})"
    return f"{name} cannot be started: {text}; unplug it and plug it in again"
