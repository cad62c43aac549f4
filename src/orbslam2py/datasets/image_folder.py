# SPDX-License-Identifier: BSD-3-Clause
"""A folder of images, in the order of their names."""

from __future__ import annotations

import logging
import os
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import index_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py.datasets.base import Images
from orbslam2py.datasets.choose_settings import SettingsChoice
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
from orbslam2py.datasets.pair_names import find_series
from orbslam2py.datasets.time_files import stamps_of_names
from orbslam2py.datasets.unposed import UnposedSource, chosen_stamps
from orbslam2py.errors import DatasetError
from orbslam2py.settings import ImuSettings, Sensor, Settings, read_imu_settings

_log = logging.getLogger(__name__)

_SETTINGS_FILE = "settings.yaml"


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key in which numbers count as numbers: ``2.png`` comes before ``10.png``."""
    parts = re.findall(r"[0-9]+|[^0-9]+", name)
    return tuple((0, int(p), p) if p[0] in "0123456789" else (1, 0, p.lower()) for p in parts)


def image_files(folder: Path) -> list[Path]:
    """Find the images of a folder (without its subfolders) in natural order of their names.

    Raises
    ------
    DatasetError
        If the folder cannot be listed.
    """
    try:
        with os.scandir(folder) as entries:  # distinguishes folders without a stat of every file
            names = [
                entry.name
                for entry in entries
                if Path(entry.name).suffix.lower() in IMAGE_SUFFIXES
                and not entry.name.startswith(".")
                and not entry.is_dir()
            ]
    except OSError as error:
        raise DatasetError(
            f"cannot list {folder}: {error.strerror or error}; give a folder of images"
        ) from error
    return [folder / name for name in sorted(names, key=lambda name: (natural_key(name), name))]


class ImageFolder(FramesInOrder, UnposedSource):
    """The images of a folder; see `datasets.base.Sequence`.

    Parameters
    ----------
    folder
        The folder of the images, without its subfolders.
    sensor
        Monocular; with split images also stereo, which is then the default.
    settings
        Settings, a file, a built-in name, or None for ``settings.yaml`` in the folder.
    fps
        Images per second; by default the times in the names, if all are times
        (``1357847239208312.tiff``), else the rate of the settings.
    times
        File with one time stamp per image, in the order of the images; or a list of images with
        their time stamps, such as ``rgb.txt`` of TUM RGB-D.
    split
        Whether the left and right half of every image are the left and right view.

    Raises
    ------
    DatasetError
        If there are no images, or the time stamps do not fit them.
    SettingsError
        If there are no settings, or they are invalid.
    """

    layout = "images"

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        fps: float | None = None,
        times: str | Path | None = None,
        split: bool = False,
    ) -> None:
        self.folder = Path(folder)
        self.paths = image_files(self.folder)
        stems = [path.stem for path in self.paths]
        series = None if split else find_series(self.paths)
        if series is not None:
            stems, self.paths = list(series.left), list(series.left.values())
            _log.warning(
                "%s has a left and a right series (%s*, %s*); taking the %d left images alone",
                *(self.folder, *series.sides, len(stems)),
            )
        if not self.paths:
            raise DatasetError(
                f"no images in {self.folder}: looked for {', '.join(sorted(IMAGE_SUFFIXES))}"
            )
        own = self.folder / _SETTINGS_FILE
        if settings is None and own.is_file():
            settings = own
        super().__init__(self.folder, self.folder.resolve().name, sensor, settings, fps, split)
        names = [path.name for path in self.paths]
        # Without either, lists of images such as NCLT's: their names are their times.
        own_times = (
            stamps_of_names(list(map(Path, stems))) if fps is None and times is None else None
        )
        otherwise = own_times or self.settings.camera.fps
        self._stamps = chosen_stamps(
            len(names), fps, times, otherwise, names, self.settings.camera.fps
        )

        self._grey_scale = GreyScale(self.folder, self._sample)
        for first in read_sample(self.paths[:1]):
            refuse_first_depth(self.paths[0], with_depth=False)
            self.check_size(first)

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def timestamps(self) -> FloatArray:
        """Time of every frame in seconds, float64 (n,); read-only."""
        return self._stamps.seconds

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds, with all digits of the source."""
        return self._stamps.texts[index_of(index, len(self))]

    def default_settings(self) -> Settings:
        """Return the settings; an image folder has none of its own."""
        return self.settings

    def image_path(self, index: int, /) -> Path:
        """Return the file of a frame."""
        return self.paths[index]

    def load(self, index: int, /) -> Images:
        """Read the image of a frame; see `datasets.base.Sequence.load`."""
        path = self.paths[index_of(index, len(self))]
        return self._delivered(read_image(path, rgb=False, to_8_bits=self._to_8_bits))

    def imu(self) -> ImuSamples | None:
        """Read the samples of the IMU in ``imu.csv`` of the folder; None if there is none.

        Raises
        ------
        DatasetError
            Naming the line that is wrong.
        """
        path = self.folder / "imu.csv"
        return read_imu_csv(path) if path.is_file() else None

    def imu_settings(self) -> ImuSettings | None:
        """Read ``imu.yaml`` in the folder; None if there is none.

        Raises
        ------
        SettingsError
            Naming the key that is wrong.
        """
        path = self.folder / "imu.yaml"
        return read_imu_settings(path) if path.is_file() else None

    def _to_8_bits(self, image: NDArray[np.generic], path: Path) -> ByteArray:
        refuse_depth(path, image, with_depth=False)
        return self._grey_scale(image)

    def _sample(self) -> list[NDArray[np.generic]]:
        return read_sample(self.paths[index] for index in spread_over(len(self)))
