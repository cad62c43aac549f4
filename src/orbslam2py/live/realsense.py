# SPDX-License-Identifier: BSD-3-Clause
"""RealSense cameras, by Intel's SDK: infrared pair, colour with depth, and IMU."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import pyrealsense2 as rs

from orbslam2py.errors import DatasetError
from orbslam2py.live.device import FoundDevice, Request, Sink, Stream
from orbslam2py.live.realsense_modes import Plan, list_modes, make_plan
from orbslam2py.live.usb import find_usb
from orbslam2py.settings import ImuSettings, Sensor, Settings

_VENDOR = ("8086",)
_RULE = (
    "you may not use it: install the udev rule of the SDK, 99-realsense-libusb.rules, in "
    "/etc/udev/rules.d (https://github.com/IntelRealSense/librealsense/tree/master/config), then "
    "'sudo udevadm control --reload-rules && sudo udevadm trigger', and plug it in again"
)
#: Milliseconds to wait for an image before looking whether to stop.
_WAIT = 100
#: Images of depth that wait to be registered.
_DEPTHS = 8
#: Options of the parts of a camera: one clock for all of them.
_GLOBAL_TIME = rs.option.global_time_enabled


class RealSense:
    """A RealSense camera; see `device.Device`.

    Parameters
    ----------
    name
        Name for messages.
    find
        Returns a new SDK object of the camera at each call: it may have been plugged in again.
    request
        The request of the user.

    Raises
    ------
    DatasetError
        If it is not there, or has no such streams.
    """

    kind = "realsense"

    def __init__(self, name: str, find: Callable[[], Any], request: Request) -> None:
        self.name = name
        self._find = find
        self._request = request
        self._started: list[Any] = []
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._clock: _Times | None = None

    @cached_property
    def _plan(self) -> Plan:
        return make_plan(self._find(), self.name, self._request)

    @property
    def streams(self) -> tuple[Stream, ...]:
        """The streams that it will deliver."""
        images = tuple(one.stream for one in self._plan.images if one.stream is not None)
        return (*images, "imu") if self._plan.motion else images

    def settings(self) -> Settings | None:
        """Make settings of the factory calibration; see `device.Device.settings`."""
        return self._plan.settings(self.name)

    def imu_settings(self) -> ImuSettings | None:
        """Return place and usual noise of the IMU."""
        return self._plan.imu_settings()

    def start(self, sink: Sink, /) -> None:
        """Open and start the streams; see `device.Device.start`."""
        device = self._find()
        # The modes of the first time: the frames must not change.
        plan = make_plan(device, self.name, self._request)
        self._stop = threading.Event()
        self._clock = _Times(sink)
        _watch_for_removal(device, sink)
        try:
            self._start_motion(plan, sink)
            if plan.kind is Sensor.RGBD:
                self._start_registered(plan, sink)
            else:
                self._start_images(plan, sink)
        except RuntimeError as error:
            self.stop()
            raise DatasetError(_problem(self.name, str(error))) from error

    def stop(self) -> None:
        """Stop and close the streams; see `device.Device.stop`."""
        self._stop.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
            self._thread = None
        for sensor in self._started:
            for end in (sensor.stop, sensor.close):
                with contextlib.suppress(RuntimeError):  # it is gone already
                    end()
        self._started = []

    # ---- streams ---------------------------------------------------------------------------------
    def _start_images(self, plan: Plan, sink: Sink) -> None:
        names = {_key(one.profile): one.stream for one in plan.images}
        clock, stop = self._clock, self._stop
        assert clock is not None

        def take(frame: Any) -> None:
            stream = names.get(_key(frame.profile))
            if stream is not None and not stop.is_set():
                stamp, exposure = clock.of(frame)
                sink.image(stream, _pixels(frame), stamp, exposure=exposure)

        self._open(plan.images[0].sensor, [one.profile for one in plan.images], take, emitter=False)

    def _start_registered(self, plan: Plan, sink: Sink) -> None:
        """Start colour and depth; the SDK registers depth to colour, in about 2 ms."""
        clock, stop = self._clock, self._stop
        assert clock is not None
        colour, depth = plan.images
        first_colour: queue.Queue[Any] = queue.Queue()
        kept: list[bool] = []
        depths = rs.frame_queue(_DEPTHS)

        def take(frame: Any) -> None:
            if stop.is_set():
                return
            if not kept:
                kept.append(True)
                frame.keep()
                first_colour.put(frame)
            stamp, exposure = clock.of(frame)
            sink.image("image", _pixels(frame), stamp, exposure=exposure)

        def run() -> None:
            try:
                _register(depths, first_colour, clock, sink, stop)
            except RuntimeError as error:
                sink.fault(f"failed: {error}")

        self._open(colour.sensor, [colour.profile], take)
        self._open(depth.sensor, [depth.profile], depths, emitter=True)
        self._thread = threading.Thread(target=run, name="realsense", daemon=True)
        self._thread.start()

    def _start_motion(self, plan: Plan, sink: Sink) -> None:
        if not plan.motion:
            return
        clock, stop = self._clock, self._stop
        assert clock is not None

        def take(frame: Any) -> None:
            if stop.is_set():
                return
            value = frame.as_motion_frame().get_motion_data()
            stamp, _ = clock.of(frame)
            row = np.array([[stamp, value.x, value.y, value.z]])
            is_gyro = frame.profile.stream_type() == rs.stream.gyro
            (sink.gyro if is_gyro else sink.accel)(row)

        self._open(plan.motion[0].sensor, [one.profile for one in plan.motion], take)

    def _open(
        self, sensor: Any, profiles: list[Any], target: Any, *, emitter: bool | None = None
    ) -> None:
        if sensor.supports(_GLOBAL_TIME):
            sensor.set_option(_GLOBAL_TIME, 1)
        if emitter is not None and sensor.supports(rs.option.emitter_enabled):
            # Its dots move with the camera: to the tracking they look like things that stand still.
            sensor.set_option(rs.option.emitter_enabled, float(emitter))
        sensor.open(profiles)
        self._started.append(sensor)
        sensor.start(target)


class _Times:
    """Middle of the exposure of frames, on the clock of the camera and of ``time.monotonic()``."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink

    def of(self, frame: Any) -> tuple[float, float | None]:
        """Return the stamp [s], and the exposure if the clock is that of this computer."""
        stamp = frame.get_timestamp() / 1e3
        read, exposed = rs.frame_metadata_value.frame_timestamp, _EXPOSED
        if frame.supports_frame_metadata(read) and frame.supports_frame_metadata(exposed):
            stamp -= (frame.get_frame_metadata(read) - frame.get_frame_metadata(exposed)) / 1e6
        domain = frame.get_frame_timestamp_domain()
        if domain == rs.timestamp_domain.system_time:
            self._sink.warning(
                "gives times of arrival, not of exposure: the kernel passes no metadata of its "
                "frames on; install the SDK's kernel modules, or its build for user space (RSUSB)"
            )
        if domain == rs.timestamp_domain.hardware_clock:
            return stamp, None
        return stamp, time.monotonic() - (time.time() - stamp)


#: The middle of the exposure in the metadata of a frame.
_EXPOSED = rs.frame_metadata_value.sensor_timestamp


def _register(
    depths: Any, colours: queue.Queue[Any], clock: _Times, sink: Sink, stop: threading.Event
) -> None:
    """Deliver depth at the pixels of colour.

    The SDK registers depth to the colour image of the same set. It only needs the calibration of
    the latter, so that one colour image serves for all: the images are paired later, by their
    stamps.
    """
    pair: list[Any] = []
    align, registered = rs.align(rs.stream.color), rs.frame_queue(1)

    def put_together(_: Any, source: Any) -> None:
        source.frame_ready(source.allocate_composite_frame(pair))

    both = rs.processing_block(put_together)
    both.start(registered)
    colour = None
    while not stop.is_set():
        if colour is None:
            with contextlib.suppress(queue.Empty):
                colour = colours.get(timeout=_WAIT / 1e3)
            continue
        came, depth = depths.try_wait_for_frame(_WAIT)
        if came and not stop.is_set():
            pair[:] = [depth, colour]
            both.invoke(depth)
            frames = align.process(registered.wait_for_frame().as_frameset())
            stamp, exposure = clock.of(depth)
            sink.image("depth", _pixels(frames.get_depth_frame()), stamp, exposure=exposure)


def _pixels(frame: Any) -> Any:
    """Copy the pixels: the SDK uses its memory again."""
    pixels = np.asanyarray(frame.get_data())
    if frame.profile.format() == rs.format.rgb8:
        return np.ascontiguousarray(pixels[:, :, ::-1])
    return pixels.copy()


def _key(profile: Any) -> tuple[Any, int]:
    return profile.stream_type(), profile.stream_index()


def _watch_for_removal(device: Any, sink: Sink) -> None:
    """Report it to the sink when the camera is unplugged."""

    def changed(information: Any) -> None:
        if information.was_removed(device):
            sink.fault("was unplugged")

    _context().set_devices_changed_callback(changed)


# ---- finding cameras -----------------------------------------------------------------------------
def _context() -> Any:
    """Return the context of the SDK, which must live as long as its cameras."""
    if not _contexts:
        _contexts.append(rs.context())
    return _contexts[0]


_contexts: list[Any] = []


def open_device(request: Request) -> RealSense:
    """Make the device of ``realsense:`` or ``realsense:SERIAL``, not started."""
    name = f"realsense:{request.address}"
    return RealSense(name, lambda: _find(name, request.address), request)


def find_devices() -> list[FoundDevice]:
    """List the cameras that are plugged in."""
    found = [
        FoundDevice(
            f"realsense:{_told(device, rs.camera_info.serial_number)}",
            _told(device, rs.camera_info.name),
            tuple(list_modes(device)),
        )
        for device in _context().query_devices()
    ]
    if not found:
        found = [
            FoundDevice("realsense:", f"{one.product} ({_RULE})")
            for one in find_usb(_VENDOR, "realsense")
            if not one.is_allowed
        ]
    return found


def _find(name: str, serial: str) -> Any:
    devices = list(_context().query_devices())
    serials = [_told(device, rs.camera_info.serial_number) for device in devices]
    for device, number in zip(devices, serials, strict=True):
        if serial in ("", number):
            return device
    if devices:
        raise DatasetError(
            f"{name} is not there; plugged in are: "
            f"{', '.join(f'realsense:{number}' for number in serials)}"
        )
    for one in find_usb(_VENDOR, "realsense"):
        if not one.is_allowed:
            raise DatasetError(f"{name}: {one.product} is plugged in, but {_RULE}")
        raise DatasetError(
            f"{name}: {one.product} is plugged in, but the SDK does not find it; it may be in use "
            "by another program such as the RealSense Viewer or a ROS node: close it"
        )
    raise DatasetError(
        f"{name} is not there: no RealSense camera is plugged in; plug it into a USB 3 port; "
        "'orbslam2py devices' lists connected cameras"
    )


def _told(device: Any, what: Any) -> str:
    return str(device.get_info(what)) if device.supports(what) else ""


def _problem(name: str, text: str) -> str:
    """Explain an error of the SDK to the user."""
    low = text.lower()
    if "busy" in low or "errno=16" in low or "in use" in low:
        return (
            f"{name} is in use by another program, such as the RealSense Viewer or a ROS node; "
            f"close it ({text})"
        )
    if "permission" in low or "access" in low or "errno=13" in low:
        return f"{name}: {_RULE} ({text})"
    return f"{name} cannot be started: {text}; unplug it and plug it in again"
