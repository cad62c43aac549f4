# SPDX-License-Identifier: BSD-3-Clause
"""Cameras that OpenCV opens: webcams by their number or device file, and cameras on the network."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, cast
from urllib.parse import urlsplit

import cv2

from orbslam2py.datasets.images import quiet_opencv
from orbslam2py.errors import DatasetError
from orbslam2py.live import v4l_modes
from orbslam2py.live.device import FoundDevice, Request, Sink, Stream
from orbslam2py.settings import ImuSettings, Settings

#: Failed reads in a row, with a pause each [s], after which the camera counts as lost.
_MOST_FAILURES, _PAUSE = 20, 0.1
#: Times of the driver are older than the present by no more than this, seconds.
_OLDEST = 1.0
#: Milliseconds that opening a camera on the network, and each image, may take.
_NETWORK_TIMEOUT = 5000
#: Seconds to wait for the thread that reads; a read may block for long.
_PATIENCE = 2.0


class Capture(Protocol):
    """The used part of ``cv2.VideoCapture``; ``get`` need not be there."""

    def isOpened(self) -> bool: ...  # noqa: D102
    def set(self, prop: int, value: float, /) -> bool: ...  # noqa: D102
    def read(self) -> tuple[bool, Any]: ...  # noqa: D102
    def release(self) -> None: ...  # noqa: D102


class CaptureDevice:
    """A camera that is read by a capture of OpenCV; see `device.Device`.

    Parameters
    ----------
    name
        Name for messages.
    kind
        Prefix of the source.
    open_capture
        Opens the capture.
    problem
        Says why it cannot be opened, a whole sentence.
    request
        Size and rate that the camera is asked for.
    has_driver_times
        Whether ``CAP_PROP_POS_MSEC`` is the time of the driver on the monotonic clock.
    """

    streams: tuple[Stream, ...] = ("image",)

    def __init__(
        self,
        name: str,
        kind: str,
        open_capture: Callable[[], Capture],
        problem: Callable[[], str],
        request: Request,
        *,
        has_driver_times: bool = False,
    ) -> None:
        self.name = name
        self.kind = kind
        self._open_capture = open_capture
        self._problem = problem
        self._request = request
        self._has_driver_times = has_driver_times
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def settings(self) -> Settings | None:
        """Return None: such a camera gives no calibration."""
        return None

    def imu_settings(self) -> ImuSettings | None:
        """Return None: there is no IMU."""
        return None

    def start(self, sink: Sink, /) -> None:
        """Open the camera and read it in a thread.

        Raises
        ------
        DatasetError
            If it cannot be opened, with the reason.
        """
        with quiet_opencv():
            capture = self._open_capture()
        if not capture.isOpened():
            raise DatasetError(self._problem())
        if self._request.size is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._request.size[0])
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._request.size[1])
        if self._request.fps is not None:
            capture.set(cv2.CAP_PROP_FPS, self._request.fps)
        # An event of each thread: one that hangs must not continue when the next one begins.
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(capture, sink, self._stop), name="camera", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop reading; the thread frees the camera."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(_PATIENCE)

    def _run(self, capture: Capture, sink: Sink, stop: threading.Event) -> None:
        try:
            self._read(capture, sink, stop)
        except Exception as error:  # an exception here would end the thread unseen
            if not stop.is_set():
                sink.fault(f"failed: {error}")
        finally:
            capture.release()

    def _read(self, capture: Capture, sink: Sink, stop: threading.Event) -> None:
        failures = 0
        while not stop.is_set():
            good, image = capture.read()
            now = time.monotonic()
            if stop.is_set():
                return
            if good and image is not None:
                failures = 0
                exposed = self._driver_time(capture, now)
                sink.image("image", image, now if exposed is None else exposed, exposure=exposed)
                continue
            failures += 1
            if failures > _MOST_FAILURES:
                sink.fault("sends no more images; was it unplugged?")
                return
            stop.wait(_PAUSE)

    def _driver_time(self, capture: Capture, now: float) -> float | None:
        """When the driver got the image; None if it does not give it on the monotonic clock."""
        if not self._has_driver_times:
            return None
        told = float(cast(Any, capture).get(cv2.CAP_PROP_POS_MSEC)) / 1e3
        if 0 <= now - told <= _OLDEST:
            return told
        self._has_driver_times = False  # both kinds of times in turn would not grow
        return None


# ---- webcams -------------------------------------------------------------------------------------
def existing_cameras() -> list[int]:
    """Return the numbers of the video devices of this machine (Linux), ascending."""
    names = [path.name.removeprefix("video") for path in Path("/dev").glob("video*")]
    return sorted(int(name) for name in names if name.isdecimal())


def webcam(
    number: int,
    request: Request,
    *,
    name: str | None = None,
    open_capture: Callable[[int], Capture] | None = None,
) -> CaptureDevice:
    """Make the device of a webcam.

    Parameters
    ----------
    number
        Number of the camera among those of the machine, from 0.
    request
        Size and rate that the camera is asked for.
    name
        Name for messages; ``camera 0`` if None.
    open_capture
        Opens a camera by its number; ``cv2.VideoCapture`` if None.
    """
    name = f"camera {number}" if name is None else name
    return CaptureDevice(
        name,
        "camera",
        lambda: (open_capture or cv2.VideoCapture)(number),
        lambda: _problem_of(name, number),
        request,
        has_driver_times=open_capture is None,
    )


def _problem_of(name: str, number: int) -> str:
    """Say why a camera cannot be opened."""
    others = existing_cameras()
    there = (
        f"cameras of this machine: {', '.join(map(str, others))}"
        if others
        else "this machine has none (no /dev/video*)"
    )
    hint = "it may be in use, or not allowed for you; " if number in others else ""
    file = Path(f"/dev/video{number}")
    if file.exists():
        if not os.access(file, os.R_OK | os.W_OK):
            hint = (
                f"you may not use {file}; add yourself to its group with 'sudo usermod -aG video "
                "$USER' and log in again, or write a udev rule for it: "
                'SUBSYSTEM=="video4linux", MODE="0666" in /etc/udev/rules.d/99-video.rules; '
            )
        else:
            hint = (
                f"it may be in use by another program: 'fuser {file}' names it; close it; some "
                "cameras have a second device file that sends no images: try another number; "
            )
    return f"{name} cannot be opened; {hint}{there}"


def open_device(request: Request) -> CaptureDevice:
    """Make the device of ``v4l:0``, ``v4l:/dev/video0`` or ``rtsp://host/path``, not started.

    Raises
    ------
    DatasetError
        If the address is invalid.
    """
    address = request.address
    if "://" in address:
        return _network_camera(address, request)
    number = address or "0"
    if number.startswith("/dev/"):
        number = Path(number).resolve().name.removeprefix("video")  # also /dev/v4l/by-id/...
    if not (number.isascii() and number.isdecimal()):
        raise DatasetError(
            f"v4l:{address} names no camera; give its number or its file, such as v4l:0 or "
            "v4l:/dev/video0; 'orbslam2py devices' lists those of this machine"
        )
    return webcam(int(number), request, name=f"v4l:{address or 0}")


def find_devices() -> list[FoundDevice]:
    """List the webcams of this machine."""
    found = []
    for number in existing_cameras():
        modes = v4l_modes.modes_of(Path(f"/dev/video{number}"))
        if modes is not None:  # a device of metadata has none
            found.append(FoundDevice(f"v4l:{number}", v4l_modes.name_of(number), modes))
    return found


# ---- cameras on the network ----------------------------------------------------------------------
def _network_camera(url: str, request: Request) -> CaptureDevice:
    parts = urlsplit(url)
    if not parts.hostname:
        raise DatasetError(f"{url} names no host; give rtsp://HOST/PATH of the camera")
    # Name and password stay out of messages and reports.
    shown = parts._replace(netloc=parts.netloc.rpartition("@")[2]).geturl()
    timeouts = [
        *(cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _NETWORK_TIMEOUT),
        *(cv2.CAP_PROP_READ_TIMEOUT_MSEC, _NETWORK_TIMEOUT),
    ]
    return CaptureDevice(
        shown,
        parts.scheme,
        lambda: cv2.VideoCapture(url, cv2.CAP_FFMPEG, timeouts),
        lambda: (
            f"{shown} cannot be opened; see whether the camera is on, whether a player such as "
            "VLC opens the address, and whether it needs a name and a password: "
            "rtsp://NAME:PASSWORD@HOST/PATH"
        ),
        request,
    )
