# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of sequences on disk."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import index_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py.datasets.base import (
    Images,
    Stamps,
    choose_sensor,
)
from orbslam2py.datasets.choose_settings import SettingsChoice, choose_settings
from orbslam2py.datasets.frames import FramesInOrder
from orbslam2py.datasets.grey_scale import (
    GreyScale,
    read_sample,
    refuse_depth,
    refuse_first_depth,
    spread_over,
)
from orbslam2py.datasets.images import read_image
from orbslam2py.datasets.imu import ImuSamples
from orbslam2py.datasets.imu_csv import read_imu_csv
from orbslam2py.datasets.rectification import Rectifiers, rectifiers_of, with_rectified_images
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import (
    ImuSettings,
    Sensor,
    Settings,
    read_imu_settings,
    resolve_settings,
)
from orbslam2py.trajectory import Trajectory

#: A sequence is refused if this number of frames at its beginning have no images.
_FIRST = 10


class RecordedSequence(FramesInOrder, ABC):
    """A folder of images, opened for one sensor; see `datasets.base.Sequence`.

    Parameters
    ----------
    folder
        The folder of the sequence.
    available
        Sensors that there are images for, the richest first.
    sensor
        One of these sensors; by default the first.
    settings
        Settings, a file, a built-in name, or None to choose by the folder.

    Raises
    ------
    DatasetError
        If there are no images for the sensor.
    SettingsError
        If the settings are invalid.
    """

    layout: str
    #: Direction of up in the world of the ground truth, (3,); None if the layout does not contain
    #: it.
    up_in_truth: FloatArray | None = None
    #: Why there are no settings if none were found, and which of the built-in ones to give.
    _missing_calibration: str

    def __init__(
        self,
        folder: Path,
        available: tuple[Sensor, ...],
        sensor: Sensor | str | None,
        settings: SettingsChoice,
    ) -> None:
        self.folder = folder
        self.name = folder.resolve().name
        self.sensors = available
        self.sensor = choose_sensor(folder, sensor, available)
        self._chosen = None if settings is None else resolve_settings(settings, self.sensor)
        self._stamps = Stamps(np.zeros(0), (), ())
        #: Source of the list of images, for messages.
        self._list_path = folder
        self._grey_scale = GreyScale(folder, self._sample)

    @cached_property
    def settings(self) -> Settings:
        """The settings the caller chose, or `default_settings`; pairs come rectified by them."""
        chosen = self.default_settings() if self._chosen is None else self._chosen
        return with_rectified_images(chosen)

    def default_settings(self) -> Settings:
        """Choose by the files in the folder; see `choose_settings`."""
        return self._default_settings

    @cached_property
    def _default_settings(self) -> Settings:
        # Read once: a file reports its doubts whenever it is read.
        return choose_settings(
            self.sensor, self._settings_folders(), self._from_calibration, self._missing_calibration
        )

    @property
    def doubts(self) -> tuple[str, ...]:
        """Changes of the time stamps, and doubts: sentences that were logged."""
        return self._stamps.doubts

    def known_rate(self) -> float | None:
        """Images per second of the settings; None if there are none."""
        try:
            return self.settings.camera.fps
        except (SettingsError, DatasetError):
            return None

    def __len__(self) -> int:
        return len(self._stamps.texts)

    @property
    def timestamps(self) -> FloatArray:
        """Time of every frame in seconds, float64 (n,); read-only."""
        return self._stamps.seconds

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds, with all digits of the source."""
        return self._stamps.texts[index_of(index, len(self))]

    def require_images(self) -> None:
        """Check that at least one of the first frames has its images, and that they are no depth.

        Raises
        ------
        DatasetError
            If none has them; otherwise a run would skip a thousand frames one by one.
        """
        if len(self):
            refuse_first_depth(self._files(0)[0], with_depth=self.sensor is Sensor.RGBD)
        n = min(_FIRST, len(self))
        for missing in zip(*(self._files(index) for index in range(n)), strict=True):
            if not any(path.exists() for path in missing):
                raise DatasetError(
                    f"none of the first {n} images of {self._list_path} exists, from "
                    f"{missing[0]} on{_found_instead(self.folder, missing[0])}; put them where "
                    "the list says, or correct the list"
                )

    @abstractmethod
    def _files(self, index: int) -> tuple[Path, ...]:
        """Return the files of a frame, the image first."""

    def load(self, index: int, /) -> Images:
        """Read (and rectify) the images of a frame; see `datasets.base.Sequence.load`."""
        paths = self._files(index_of(index, len(self)))
        images = [self._read(path) for path in paths]
        if len(images) == 1:
            return Images(images[0])
        if self._rectifiers is not None:
            images = [
                rectifier.rectify(image, path)
                for rectifier, image, path in zip(self._rectifiers, images, paths, strict=True)
            ]
        return Images(images[0], right=images[1])

    @abstractmethod
    def ground_truth(self) -> Trajectory | None:
        """Read the true poses; see `datasets.base.Sequence.ground_truth`."""

    def imu(self) -> ImuSamples | None:
        """Read the samples of the IMU at each call; nothing is read before.

        By default those of ``imu.csv`` in the folder; see `read_imu_csv`.

        Returns
        -------
        ImuSamples or None
            On the clock of `timestamps`, in rad/s and m/s^2; None if the recording has none.

        Raises
        ------
        DatasetError
            The message names the file and the line.
        """
        path = self._beside("imu.csv")
        return None if path is None else read_imu_csv(path)

    def imu_settings(self) -> ImuSettings | None:
        """Read the IMU settings of the recording; None if there are none.

        By default ``imu.yaml`` in the folder, with the keys of ORB-SLAM3; see `read_imu_settings`.

        ``T_ci`` is for the unrectified camera.

        Raises
        ------
        SettingsError
            The message names the file and the key.
        """
        path = self._beside("imu.yaml")
        return None if path is None else read_imu_settings(path)

    def _beside(self, name: str) -> Path | None:
        """Return a file in the folders that may contain settings."""
        paths = (folder / name for folder in self._settings_folders())
        return next((path for path in paths if path.is_file()), None)

    @cached_property
    def _rectifiers(self) -> Rectifiers | None:
        return rectifiers_of(self.settings)

    def _read(self, path: Path) -> ByteArray:
        """Read an image in the colour order of the settings; 16 bits become 8."""
        return read_image(path, rgb=self.settings.camera.rgb, to_8_bits=self._to_8_bits)

    def _to_8_bits(self, image: NDArray[np.generic], path: Path) -> ByteArray:
        refuse_depth(path, image, with_depth=self.sensor is Sensor.RGBD)
        return self._grey_scale(image)

    def _sample(self) -> list[NDArray[np.generic]]:
        """Return images of the (left) camera, distributed over the sequence."""
        return read_sample(self._files(index)[0] for index in spread_over(len(self)))

    def _settings_folders(self) -> tuple[Path, ...]:
        return (self.folder,)

    def _from_calibration(self) -> Settings | None:
        return None


def _found_instead(folder: Path, missing: Path) -> str:
    """Return other images in the folder, or otherwise the place of the image."""
    if missing.parent.is_dir():
        names = [p.name for p in missing.parent.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES]
        return f" (there is {missing.parent / min(names)})" if names else ""
    inner = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    for place in (folder, *inner):
        if (place / missing.name).exists():
            return f" (there is {place / missing.name})"
    return f" ({missing.parent} does not exist)"
