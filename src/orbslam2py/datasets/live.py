# SPDX-License-Identifier: BSD-3-Clause
"""A camera that delivers images while it is used."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray
from orbslam2py._sixteen_bits import FollowingRange
from orbslam2py.datasets.base import LiveFrame
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.images import quiet_opencv
from orbslam2py.datasets.unposed import UnposedSource
from orbslam2py.errors import DatasetError, StateError
from orbslam2py.settings import Sensor

_log = logging.getLogger(__name__)

#: Seconds between two looks at whether somebody wants to stop.
_WAIT_SLICE = 0.1
#: Seconds without an image after which the camera counts as gone.
_PATIENCE = 10.0
#: Failed reads in a row, with a short pause each, after which the camera counts as gone.
_MOST_FAILURES = 20


class Capture(Protocol):
    """What is used of ``cv2.VideoCapture``."""

    def isOpened(self) -> bool: ...  # noqa: D102
    def set(self, prop: int, value: float, /) -> bool: ...  # noqa: D102
    def read(self) -> tuple[bool, Any]: ...  # noqa: D102
    def release(self) -> None: ...  # noqa: D102


def existing_cameras() -> list[int]:
    """Return the numbers of the video devices of this machine (Linux), ascending."""
    names = [path.name.removeprefix("video") for path in Path("/dev").glob("video*")]
    return sorted(int(name) for name in names if name.isdecimal())


class LiveCamera(UnposedSource):
    """A camera of this machine, read in a thread of its own; see `datasets.base.LiveSource`.

    There is room for one image: a newer one takes its place, so that a slow reader is never
    behind; `n_dropped` counts the images that were lost that way.

    Parameters
    ----------
    number
        Number of the camera among those of the machine, from 0.
    sensor
        Monocular; if images are split also stereo, the default then.
    settings
        Settings, a file or a built-in name. The camera is asked for their image size, or for twice
        their width if images are split.
    fps
        Images per second that the camera is asked for; by default it decides.
    open_capture
        Opens a camera by its number.
    split
        Whether every image holds the left view in its left half, the right view in its right half.

    Raises
    ------
    SettingsError
        If there are no settings, or they are wrong.

    Examples
    --------
    >>> with LiveCamera(0, settings="my_camera.yaml") as camera:  # doctest: +SKIP
    ...     for frame in camera:
    ...         slam.track_monocular(frame.images.image, frame.timestamp)
    """

    layout = "camera"

    def __init__(
        self,
        number: int,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        fps: float | None = None,
        open_capture: Callable[[int], Capture] = cv2.VideoCapture,
        split: bool = False,
    ) -> None:
        super().__init__(f"camera {number}", f"camera{number}", sensor, settings, fps, split)
        self.number = number
        self._fps = fps
        self._open_capture = open_capture
        self._capture: Capture | None = None
        self._thread: threading.Thread | None = None
        # Guards the fields below; notified when one of them changes.
        self._changed = threading.Condition()
        self._newest: tuple[float, ByteArray] | None = None
        self._n_dropped = 0
        self._failure: str | None = None
        self._stopped = False
        self._seen_at = 0.0
        self._range: FollowingRange | None = None

    @property
    def n_dropped(self) -> int:
        """Images lost so far because nobody had taken the one before."""
        with self._changed:
            return self._n_dropped

    def __enter__(self) -> LiveCamera:
        """Open the camera and start reading.

        Raises
        ------
        DatasetError
            If it cannot be opened, with the cameras there are.
        """
        if self._thread is not None:
            raise StateError(f"camera {self.number} is open already, or was; make a new object")
        self.open()
        self._seen_at = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(_PATIENCE)
            if self._thread.is_alive():
                _log.warning("camera %d does not answer; it is not waited for", self.number)
                return
        if self._capture is not None:
            self._capture.release()

    def open(self) -> None:
        """Open the camera, without reading yet; entering the context does it if this did not.

        Raises
        ------
        DatasetError
            If it cannot be opened, with the cameras there are.
        """
        if self._capture is not None:
            return
        with quiet_opencv():
            capture = self._open_capture(self.number)
        if not capture.isOpened():
            others = existing_cameras()
            there = (
                f"cameras of this machine: {', '.join(map(str, others))}"
                if others
                else "this machine has none (no /dev/video*)"
            )
            hint = "; it may be in use, or not allowed for you" if self.number in others else ""
            raise DatasetError(f"camera {self.number} cannot be opened{hint}; {there}")
        camera = self.settings.camera
        if camera.width is not None and camera.height is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, (1 + self._split) * camera.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, camera.height)
        if self._fps is not None:
            capture.set(cv2.CAP_PROP_FPS, self._fps)
        self._capture = capture

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
        StateError
            If the camera was not opened by entering the context.
        """
        if self._thread is None:
            raise StateError("open the camera first: with LiveCamera(...) as camera")
        with self._changed:
            self._changed.wait_for(lambda: self._newest or self._failure, timeout)
            taken, self._newest = self._newest, None
            if taken is None:
                if self._failure is not None:
                    raise DatasetError(self._failure)
                if time.monotonic() > self._seen_at + _PATIENCE:
                    raise DatasetError(
                        f"camera {self.number} has sent no image for {_PATIENCE:g} s"
                    )
                return None
        timestamp, image = taken
        return LiveFrame(timestamp, f"{timestamp:.6f}", self._delivered(image))

    def __iter__(self) -> Iterator[LiveFrame]:
        """Yield the newest image again and again; see `take`."""
        while not self._stopped:
            # In slices, so that Ctrl-C is seen.
            frame = self.take(_WAIT_SLICE)
            if frame is not None:
                yield frame

    def _run(self) -> None:
        assert self._capture is not None
        try:
            self._read_until_stopped(self._capture)
        except Exception as error:  # an exception here would end the thread unseen
            self._fail(f"camera {self.number} failed: {error}")

    def _read_until_stopped(self, capture: Capture) -> None:
        # Wall clock at the start, monotonic from then on: time stamps must grow.
        offset = time.time() - time.perf_counter()
        failures, last = 0, 0.0
        while not self._stopped:
            good, image = capture.read()
            if not good or image is None:
                failures += 1
                if failures > _MOST_FAILURES:
                    self._fail(f"camera {self.number} sends no more images; was it unplugged?")
                    return
                time.sleep(_WAIT_SLICE)
                continue
            failures = 0
            # Microseconds are kept: two images within one would get the same text.
            last = max(round(time.perf_counter() + offset, 6), round(last + 1e-6, 6))
            with self._changed:
                self._n_dropped += self._newest is not None
                self._newest = (last, self._in_8_bits(image))
                self._seen_at = time.monotonic()
                self._changed.notify_all()

    def _in_8_bits(self, image: NDArray[np.generic]) -> ByteArray:
        if image.dtype != np.uint16:
            return np.asarray(image, dtype=np.uint8)
        if self._range is None:
            self._range = FollowingRange()
            _log.info("%s: images of 16 bits; scaled to 8 by a range that follows them", self._what)
        return self._range.to_8_bits(image)

    def _fail(self, message: str) -> None:
        with self._changed:
            self._failure = message
            self._changed.notify_all()
