# SPDX-License-Identifier: BSD-3-Clause
"""The mechanism that all live sources share: from a device to frames."""

from __future__ import annotations

import contextlib
import logging
import re
import threading
import time
import weakref
from collections.abc import Iterator
from dataclasses import replace

from orbslam2py.datasets.base import FrameTimes, LiveFrame
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.preparation import Preparation
from orbslam2py.datasets.rectification import with_rectified_images
from orbslam2py.datasets.unposed import no_settings, with_rate
from orbslam2py.errors import DatasetError, StateError
from orbslam2py.live.device import Device, Stream
from orbslam2py.live.inlet import Inlet, Tap
from orbslam2py.live.reports import Reports
from orbslam2py.settings import ImuSettings, Sensor, Settings, resolve_settings
from orbslam2py.trajectory import Trajectory

_log = logging.getLogger(__name__)

#: Seconds between checks whether the run should stop.
_WAIT_SLICE = 0.1
#: Seconds without a complete frame after which a device counts as lost.
SILENCE = 5.0
#: Seconds between two attempts to start a lost device, and between two messages about it.
_RETRY, _REMIND = 1.0, 30.0
#: Seconds that a device may take to stop at the end.
_PATIENCE = 10.0
#: Largest time between the images of a pair, seconds. A pair is exposed at once.
MAX_SKEW_OF_PAIR = 0.005
#: Largest time between image and depth, seconds, and as a part of the time between two frames.
MAX_SKEW_OF_DEPTH, _PART_OF_STEP = 0.02, 0.5
#: Frames that wait for the reader, by default.
ROOM = 3


class LiveStream:
    """Frames of a device, made in its threads and taken by a reader; see `datasets.LiveSource`.

    Images are paired by their stamps. A bounded queue holds complete frames: the oldest is dropped
    and counted, samples of the IMU never are. If the device is lost, sends images of another size
    or falls silent, this is reported and the device is started again until it answers; frames then
    continue, with growing times.

    Parameters
    ----------
    device
        What delivers.
    sensor
        Sensor for which the images are used; by default the richest that the streams of the device
        can do.
    settings
        Settings, a file or a built-in name; by default those of the device.
    fps
        Expected frames per second; replaces that of the settings.
    split
        Whether every image holds the left view in its left half, the right view in its right half.
    room
        Most frames that wait for the reader.
    max_skew
        Largest time between the images of one moment, seconds; by default 0.005 for a pair, and
        half the time between two frames, at most 0.02, for image and depth.
    patience
        Seconds to wait for a lost device before `take` raises; None: as long as it takes.

    Raises
    ------
    DatasetError
        If the device cannot be used, or does not deliver images for the sensor.
    SettingsError
        If there are no settings, or they are wrong.

    Examples
    --------
    >>> with LiveStream(device, "stereo") as source:  # doctest: +SKIP
    ...     for frame in source:
    ...         slam.track(frame.images, frame.timestamp)
    """

    def __init__(
        self,
        device: Device,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        fps: float | None = None,
        split: bool = False,
        room: int = ROOM,
        max_skew: float | None = None,
        patience: float | None = None,
    ) -> None:
        self.device = device
        self.name = re.sub(r"[^\w.-]+", "_", device.name.replace(" ", "")).strip("_")
        self.layout = device.kind
        self.sensor = _choose_sensor(device, sensor, split=split)
        chosen = device.settings() if settings is None else settings
        if chosen is None:
            raise no_settings(device.name)
        self.settings: Settings = resolve_settings(chosen, self.sensor)
        if fps is not None:
            self.settings = replace(self.settings, camera=with_rate(self.settings.camera, fps))
        self.settings = with_rectified_images(self.settings)
        self.imu_settings: ImuSettings | None = (
            device.imu_settings() if "imu" in device.streams else None
        )
        #: Whether every image holds two views side by side.
        self.is_split = split and self.sensor is Sensor.STEREO
        self._reports = Reports(device.name)
        rate = self.settings.camera.fps
        skew = _usual_skew(device.streams, rate) if max_skew is None else max_skew
        self._inlet = Inlet(device.streams, skew, rate, room, self._reports)
        self._preparation = Preparation(device.name, self.sensor, self.settings, split=split)
        self._patience = patience
        self._supervisor: threading.Thread | None = None
        self._started_at: float | None = None
        self._end: weakref.finalize[..., LiveStream] | None = None
        self._stopped = threading.Event()
        self._lost_at: float | None = None
        self._n_restarts = 0
        self._seconds_lost = 0.0
        self._last_time = 0.0

    @property
    def n_dropped(self) -> int:
        """Number of frames that were lost so far because they were not read in time."""
        return self._inlet.n_dropped

    @property
    def has_imu(self) -> bool:
        """Whether frames come with samples of an IMU."""
        return self._inlet.has_imu

    @property
    def doubts(self) -> list[str]:
        """What went wrong so far, whole sentences; all were logged."""
        return self._reports.listed()

    def counts(self) -> dict[str, float]:
        """Return numbers of frames, losses and samples so far; see the keys of ``report.json``."""
        now = time.monotonic()
        lost = self._seconds_lost + (0.0 if self._lost_at is None else now - self._lost_at)
        return {
            **self._inlet.counts(),
            "restarts": self._n_restarts,
            "seconds_lost": round(lost, 3),
        }

    def set_tap(self, tap: Tap | None) -> None:
        """Have a function called with every complete frame and all samples, before any is lost."""
        self._inlet.tap = tap

    def ground_truth(self) -> Trajectory | None:
        """Return None: there are no true poses."""
        return None

    # ---- begin and end ---------------------------------------------------------------------------
    def open(self) -> None:
        """Start the device; entering the context does it if this did not.

        Raises
        ------
        DatasetError
            If it cannot be started, with the remedy.
        """
        if self._started_at is None:
            self.device.start(self._inlet)
            self._started_at = time.monotonic()
            # If the user does not close it: threads of the device must not outlive the interpreter.
            self._end = weakref.finalize(self, _end, self._inlet, self.device)

    def __enter__(self) -> LiveStream:
        """Start the device and watch over it.

        Raises
        ------
        DatasetError
            If it cannot be started, with the remedy.
        StateError
            If it was entered before.
        """
        if self._supervisor is not None:
            raise StateError(f"{self.device.name} is open already, or was; make a new object")
        self._inlet.begin()
        self.open()
        self._started_at = time.monotonic()
        self._supervisor = threading.Thread(target=self._supervise, name="live", daemon=True)
        self._supervisor.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the device; leaving the context does it."""
        self._stopped.set()
        self._inlet.close()
        if self._end is not None:
            self._end.detach()
        stopper = threading.Thread(target=self._stop_device, name="live-stop", daemon=True)
        stopper.start()
        stopper.join(_PATIENCE)
        if self._supervisor is not None:
            self._supervisor.join(0 if stopper.is_alive() else _PATIENCE)
        if stopper.is_alive():
            _log.warning("%s does not answer; it is not waited for", self.device.name)

    # ---- frames ----------------------------------------------------------------------------------
    def take(self, timeout: float, /) -> LiveFrame | None:
        """Take the oldest frame that waits, or wait for one.

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
            If images do not fit the settings, or the device is lost for longer than `patience`.
        ImageError
            If an image cannot be split or rectified.
        StateError
            If the source was not opened by entering the context.
        """
        if self._supervisor is None:
            raise StateError(f"open {self.device.name} first: with LiveStream(...) as source")
        found = self._inlet.next_frame(timeout)
        if found is None:
            self._check_patience()
            return None
        parts, complete, imu = found
        taken = time.monotonic()
        first = next(iter(parts.values()))
        # Microseconds are kept: two frames within one would get the same text.
        at = max(round(first.time, 6), round(self._last_time + 1e-6, 6))
        self._last_time = at
        images = self._preparation.images({name: part.array for name, part in parts.items()})
        arrival = min(part.arrival for part in parts.values())
        times = FrameTimes(first.exposure, arrival, complete, taken, time.monotonic())
        return LiveFrame(at, f"{at:.6f}", images, imu, first.stamp, times)

    def __iter__(self) -> Iterator[LiveFrame]:
        """Yield frame after frame until the source is closed; see `take`.

        Opens the source if it is not open, and closes it then when the loop ends.
        """
        if self._supervisor is None:
            with self:
                yield from self._frames()
        else:
            yield from self._frames()

    def _frames(self) -> Iterator[LiveFrame]:
        while not self._stopped.is_set():
            # In slices, so that Ctrl-C is seen.
            frame = self.take(_WAIT_SLICE)
            if frame is not None:
                yield frame

    # ---- the watch over the device ---------------------------------------------------------------
    def _supervise(self) -> None:
        while not self._stopped.is_set():
            with self._inlet.changed:
                if self._inlet.fault_text is None:
                    self._inlet.changed.wait(_WAIT_SLICE)
                fault = self._inlet.fault_text
            self._note_return()
            fault = fault or self._silence()
            if fault is not None and not self._stopped.is_set():
                self._restart(fault)

    def _silence(self) -> str | None:
        """Report that no frame has arrived for long, and what is missing; None if some did."""
        now, inlet = time.monotonic(), self._inlet
        last = max(filter(None, (inlet.last_frame, self._started_at)), default=now)
        if now - last < SILENCE:
            return None
        if inlet.other_size_since is not None:
            return "sends images of another size"
        silent = inlet.pairing.silent()
        what = f"no {' and no '.join(silent)} image" if silent else "no image"
        return f"has sent {what} for {now - last:.0f} s"

    def _restart(self, fault: str) -> None:
        if self._lost_at is None:
            self._lost_at = time.monotonic()
            self._reports.event(f"{fault}; waiting for it")
        reminded, problem = time.monotonic(), fault
        while not self._stopped.is_set():
            self._stop_device()
            if self._stopped.wait(_RETRY):
                return
            self._inlet.restart()
            self._n_restarts += 1
            try:
                self.device.start(self._inlet)
            except Exception as error:  # a lost device may fail in any way: it is tried again
                problem = str(error)
            else:
                self._started_at = time.monotonic()
                break
            if time.monotonic() > reminded + _REMIND:
                reminded = time.monotonic()
                _log.warning("%s is still waited for: %s", self.device.name, problem)
        if self._stopped.is_set():  # it was stopped while it started
            self._stop_device()

    def _note_return(self) -> None:
        last = self._inlet.last_frame
        if self._lost_at is not None and last is not None and last > self._lost_at:
            away = last - self._lost_at
            self._seconds_lost += away
            self._lost_at = None
            self._reports.event(f"is back after {away:.1f} s")

    def _check_patience(self) -> None:
        lost = self._lost_at
        if self._patience is not None and lost is not None:
            away = time.monotonic() - lost
            if away > self._patience:
                raise DatasetError(
                    f"{self.device.name} was lost and did not come back in {away:.0f} s; see "
                    "whether it is plugged in and switched on"
                )

    def _stop_device(self) -> None:
        try:
            self.device.stop()
        except Exception as error:  # a lost device may fail in any way; the run must not
            _log.info("%s did not stop cleanly: %s", self.device.name, error)


def _end(inlet: Inlet, device: Device) -> None:
    """Stop a device that is still running when its source is collected or the program ends."""
    inlet.close()
    with contextlib.suppress(Exception):  # a lost device may fail in any way
        device.stop()


def _usual_skew(streams: tuple[Stream, ...], rate: float) -> float:
    if "depth" in streams:
        return min(MAX_SKEW_OF_DEPTH, _PART_OF_STEP / rate)
    return MAX_SKEW_OF_PAIR


def _choose_sensor(device: Device, wanted: Sensor | str | None, *, split: bool) -> Sensor:
    """Return the wanted sensor, or the richest that the streams can do.

    Raises
    ------
    DatasetError
        If the device does not deliver images for it.
    """
    streams = device.streams
    able = {
        Sensor.RGBD: "depth" in streams and "image" in streams,
        Sensor.STEREO: ("left" in streams and "right" in streams) or split,
        Sensor.MONOCULAR: "image" in streams or "left" in streams,
    }
    if wanted is None:
        return next(sensor for sensor, can in able.items() if can)
    wanted = Sensor(wanted)
    if not able.get(wanted, False):
        names = ", ".join(str(sensor) for sensor, can in able.items() if can)
        advice = (
            "; if every image holds the left and the right view side by side, take --split of "
            "'orbslam2py run'"
            if wanted is Sensor.STEREO and streams == ("image",)
            else ""
        )
        raise DatasetError(
            f"{device.name} has no {wanted} images; it can be used as: {names}{advice}"
        )
    return wanted
