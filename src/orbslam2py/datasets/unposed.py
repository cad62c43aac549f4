# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of images without other data: of a camera, or of a pair side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py.datasets.base import Images, Stamps, choose_sensor
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.preparation import Preparation
from orbslam2py.datasets.rectification import with_rectified_images
from orbslam2py.datasets.time_files import read_time_file, stamps_of_rate
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import BUILTIN_NAMES, CameraSettings, Sensor, Settings, resolve_settings
from orbslam2py.trajectory import Trajectory


class UnposedSource:
    """Images without ground truth and without calibration.

    Parameters
    ----------
    what
        Name of the source for messages.
    name
        Name of the source for results.
    sensor
        Monocular, or with split images stereo, which is then the default.
    settings
        Settings, a file or a built-in name.
    fps
        Images per second; replaces that of the settings if given.
    split
        Whether the left and right half of every image are the left and right view.

    Raises
    ------
    DatasetError
        For another sensor.
    SettingsError
        If there are no settings, or if they or the rate are invalid.
    """

    def __init__(
        self,
        what: str | Path,
        name: str,
        sensor: Sensor | str | None,
        settings: SettingsChoice,
        fps: float | None,
        split: bool = False,
    ) -> None:
        self.name = name
        self._split = split
        self.sensor = _choose_sensor(what, sensor, split=split)
        if settings is None:
            raise no_settings(what)
        self.settings: Settings = resolve_settings(settings, self.sensor)
        if fps is not None:
            self.settings = replace(self.settings, camera=with_rate(self.settings.camera, fps))
        self.settings = with_rectified_images(self.settings)
        self._preparation = Preparation(what, self.sensor, self.settings, split=split)

    def ground_truth(self) -> Trajectory | None:
        """Return None: there are no true poses."""
        return None

    def _delivered(self, image: NDArray[np.generic]) -> Images:
        """Convert OpenCV's image for tracking: halves, colour order, rectification.

        Raises
        ------
        DatasetError
            If it has two views side by side, and they should not be split.
        ImageError
            If it cannot be split.
        """
        return self._preparation.images({"image": image})

    def check_size(self, image: NDArray[np.generic]) -> None:
        """Compare the size of an image with the settings; see `Preparation.check_size`."""
        self._preparation.check_size(image)


def no_settings(what: object) -> SettingsError:
    """Report that the camera of the images is unknown, with the remedy."""
    return SettingsError(
        f"no settings for {what}: its camera is unknown. Give --settings "
        f"with a file or a built-in name ({', '.join(BUILTIN_NAMES)}). Make a file with "
        "'orbslam2py settings new' from the numbers of the camera, with 'orbslam2py "
        "calibrate' from images of a chessboard, or with 'orbslam2py import-camera' from a "
        "calibration you have"
    )


def _choose_sensor(what: str | Path, sensor: Sensor | str | None, *, split: bool) -> Sensor:
    available = (Sensor.STEREO, Sensor.MONOCULAR) if split else (Sensor.MONOCULAR,)
    if not split and sensor is not None and Sensor(sensor) is Sensor.STEREO:
        raise DatasetError(
            f"{what} has no stereo images; it can be used as: mono; if every image holds the left "
            "and the right view side by side, take --split of 'orbslam2py run'"
        )
    return choose_sensor(Path(what), sensor, available)


def with_rate(camera: CameraSettings, fps: float) -> CameraSettings:
    """Return the camera with the rate that the user gave.

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
    """Use a rate that the user gave, if there may be no settings yet; as `with_rate`."""
    return with_rate(CameraSettings(fx=1.0, fy=1.0, cx=0.0, cy=0.0), fps).fps


def chosen_stamps(
    n: int,
    fps: float | None,
    times: str | Path | None,
    otherwise: Stamps | float,
    names: Sequence[str] | None = None,
    rate: float | None = None,
) -> Stamps:
    """Choose the time stamps of images: from a rate, from a file, or their own.

    Parameters
    ----------
    n
        Number of images.
    fps
        Constant rate, or None.
    times
        File with a time stamp per image, or a list of images with their time stamps, or None.
    otherwise
        Time stamps, or a rate, if the user gives neither.
    names
        Names of the images' files, if they have any.
    rate
        Images per second by the settings, if they are known.

    Raises
    ------
    DatasetError
        If both are given, or the file does not fit.
    SettingsError
        If the rate is invalid.
    """
    if fps is not None and times is not None:
        raise DatasetError(
            "--fps and --times exclude each other: both set the time stamps; give one of them"
        )
    if times is not None:
        return read_time_file(Path(times), n, names, rate)
    if fps is not None:
        return stamps_of_rate(n, checked_rate(fps))
    return otherwise if isinstance(otherwise, Stamps) else stamps_of_rate(n, otherwise)
