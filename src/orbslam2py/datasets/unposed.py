# SPDX-License-Identifier: BSD-3-Clause
"""What images of one camera without any other data have in common."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray
from orbslam2py.datasets.base import Stamps, choose_sensor
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.time_files import read_time_file, stamps_of_rate
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import BUILTIN_NAMES, CameraSettings, Sensor, Settings, resolve_settings
from orbslam2py.trajectory import Trajectory

_log = logging.getLogger(__name__)


class UnposedSource:
    """Images of a single camera without true poses and without calibration.

    Parameters
    ----------
    what
        Name of the source for messages.
    name
        Name of the source for results.
    sensor
        Must be monocular if given.
    settings
        Settings, a file or a built-in name.
    fps
        Images per second; replaces that of the settings if given.

    Raises
    ------
    DatasetError
        For another sensor.
    SettingsError
        If there are no settings, or they or the rate are wrong.
    """

    def __init__(
        self,
        what: str | Path,
        name: str,
        sensor: Sensor | str | None,
        settings: SettingsChoice,
        fps: float | None,
    ) -> None:
        self.name = name
        self.sensor = choose_sensor(Path(what), sensor, (Sensor.MONOCULAR,))
        if settings is None:
            raise SettingsError(
                f"no settings for {what}: nothing tells what camera it is from. Give --settings "
                f"with a file or a built-in name ({', '.join(BUILTIN_NAMES)}). Make a file with "
                "'orbslam2py settings new' from the numbers of the camera, with 'orbslam2py "
                "calibrate' "
                "from images of a chessboard, or with 'orbslam2py import-camera' from a "
                "calibration "
                "you have"
            )
        self.settings: Settings = resolve_settings(settings, self.sensor)
        if fps is not None:
            self.settings = replace(self.settings, camera=with_rate(self.settings.camera, fps))
        self._what = what
        self._size_checked = False

    def ground_truth(self) -> Trajectory | None:
        """Return None: there are no true poses."""
        return None

    def _ordered(self, image: ByteArray) -> ByteArray:
        """Give OpenCV's image the colour order of the settings; look at the size of the first."""
        if not self._size_checked:
            self._size_checked = True
            self._warn_of_size(image)
        if image.ndim == 3 and self.settings.camera.rgb:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
        return np.ascontiguousarray(image)

    def _warn_of_size(self, image: ByteArray) -> None:
        camera = self.settings.camera
        given, found = (camera.width, camera.height), (image.shape[1], image.shape[0])
        if None not in given and given != found:
            _log.warning(
                "%s has images of %d x %d pixels, but the settings are for %d x %d: "
                "focal lengths and distortion do not fit",
                self._what,
                *found,
                *given,
            )


def with_rate(camera: CameraSettings, fps: float) -> CameraSettings:
    """Return the camera with the rate that was given by hand.

    Raises
    ------
    SettingsError
        If no camera has such a rate.
    """
    try:
        return replace(camera, fps=fps)
    except SettingsError as error:
        raise SettingsError(f"--fps: {error}") from None


def checked_rate(fps: float) -> float:
    """Take a rate that was given by hand where there may be no settings yet; as `with_rate`."""
    return with_rate(CameraSettings(fx=1.0, fy=1.0, cx=0.0, cy=0.0), fps).fps


def chosen_stamps(
    n: int,
    fps: float | None,
    times: str | Path | None,
    otherwise: Stamps | float,
    names: Sequence[str] | None = None,
    rate: float | None = None,
) -> Stamps:
    """Choose the time stamps of images: from a rate, from a file, or else their own.

    Parameters
    ----------
    n
        Number of images.
    fps
        Constant rate, or None.
    times
        File with a time stamp per image, or a list of images with their time stamps, or None.
    otherwise
        Time stamps, or a rate, if neither is given.
    names
        Names of the images' files, if they have any.
    rate
        Images per second by the settings, if they are known.

    Raises
    ------
    DatasetError
        If both are given, or the file does not fit.
    SettingsError
        If the rate is none.
    """
    if fps is not None and times is not None:
        raise DatasetError(
            "--fps and --times exclude each other: both tell the time stamps; give one of them"
        )
    if times is not None:
        return read_time_file(Path(times), n, names, rate)
    if fps is not None:
        return stamps_of_rate(n, checked_rate(fps))
    return otherwise if isinstance(otherwise, Stamps) else stamps_of_rate(n, otherwise)
