# SPDX-License-Identifier: BSD-3-Clause
"""KITTI raw data (Geiger et al. 2013): ``image_00/data``, ``timestamps.txt`` with dates."""

from __future__ import annotations

import logging
import re
from functools import cached_property
from pathlib import Path

import numpy as np

from orbslam2py._arguments import number_of as counted
from orbslam2py._text_lines import content_lines
from orbslam2py.datasets.base import Layout, Stamps, rate_of, require_frames
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.clock import read_clock
from orbslam2py.datasets.grey_scale import read_sample
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.imu import ImuSamples, make_samples
from orbslam2py.datasets.layouts.kitti_raw_calibration import CAMERAS_FILE, DriveCalibration
from orbslam2py.datasets.layouts.kitti_raw_poses import read_oxts, read_oxts_imu
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.trajectory import Trajectory, associate

_log = logging.getLogger(__name__)

#: Left and right camera of the grey pair, which comes first, and of the colour one.
_PAIRS = ((0, 1), (2, 3))
_USUAL_RATE = 10.0
_DATE = re.compile(r"\d{4}_\d\d_\d\d")
_PAGE = "https://www.cvlibs.net/datasets/kitti/raw_data.php"


class KittiRawSequence(RecordedSequence):
    """A drive of KITTI raw, such as ``2011_09_26_drive_0001_sync``; see `datasets.base.Sequence`.

    The grey cameras ``image_00`` and ``image_01`` are used if they exist, else the colour cameras
    ``image_02`` and ``image_03``. Time stamps are the dates of ``timestamps.txt``, as seconds since
    1970 (the clock of the car). ``calib_cam_to_cam.txt`` is in the parent folder. The raw images of
    a drive that ends in ``_extract`` are rectified for stereo; images of a single camera stay
    unchanged, with distortion.

    Parameters
    ----------
    folder
        The drive.
    sensor
        Monocular (left camera) or stereo; by default stereo if there are images of both cameras.
    settings
        Settings, a file, a built-in name, or None for the calibration of the drive.

    Raises
    ------
    DatasetError
        The message names the file, and the line if a list is malformed.
    SettingsError
        If the settings are invalid.
    """

    layout = Layout.KITTI_RAW
    up_in_truth = np.array([0.0, 0.0, 1.0])  # east, north, up

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
    ) -> None:
        folder = Path(folder)
        wanted = None if sensor is None else Sensor(sensor)
        there = [pair for pair in _PAIRS if _has_images(folder, pair[0])]
        if not there:
            raise DatasetError(f"{folder} has neither image_00/data nor image_02/data with images")
        whole = [pair for pair in there if _has_images(folder, pair[1])]
        alone = wanted is Sensor.MONOCULAR or not whole
        self._left, self._right = there[0] if alone else whole[0]
        available = (Sensor.STEREO, Sensor.MONOCULAR) if whole else (Sensor.MONOCULAR,)
        super().__init__(folder, available, sensor, settings)
        self._calibrated_by: Path | None = None
        times, self._paths = self._list(self._left)
        self._list_path = times_path = self._camera_folder(self._left) / "timestamps.txt"
        self._right_paths: list[Path] = []
        if self.sensor is Sensor.STEREO:
            others, right = self._list(self._right)
            i, j = associate(times.seconds, others.seconds)
            if len(i) < len(self._paths):
                _log.warning(
                    "%s: %d left images have no right one, left out",
                    *(folder, len(self._paths) - len(i)),
                )
            self._paths = [self._paths[k] for k in i.tolist()]
            self._right_paths = [right[k] for k in j.tolist()]
            times = _some(times, i.tolist())
        require_frames(times_path, len(self._paths))
        self._stamps = times

    @cached_property
    def settings(self) -> Settings:
        """The settings the caller chose, or `default_settings`."""
        settings = super().settings
        colour = "grey" if self._left == 0 else "colour"
        source = "the given settings"
        if self._chosen is None and self._calibrated_by is None:
            source = str(self.folder / "settings.yaml")
        elif self._chosen is None:
            kind = "raw" if self._is_raw else "rectified"
            source = f"{self._calibrated_by} (for {kind} images)"
        _log.info(
            "%s: %d frames of the %s %s; calibration: %s",
            *(self.folder, len(self), colour, self._named_cameras, source),
        )
        return settings

    @staticmethod
    def recognises(folder: Path) -> bool:
        """Return whether a folder is such a drive."""
        return any(_has_images(folder, left) for left, _ in _PAIRS)

    def image_path(self, index: int, /) -> Path:
        """Return the file of the left image of a frame."""
        return self._paths[index]

    def ground_truth(self) -> Trajectory | None:
        """Read the poses of ``oxts`` and move them to the left camera.

        See `datasets.base.Sequence.ground_truth`. The world begins at the first position: x east, y
        north, z up, in metres. None also if a calibration of the camera's pose is missing:
        ``calib_imu_to_velo.txt`` and ``calib_velo_to_cam.txt``.
        """
        if not (self.folder / "oxts" / "data").is_dir():
            return None
        missing = [name for name in DriveCalibration.VEHICLE_FILES if self._find(name) is None]
        if missing:
            _log.warning(
                "%s is not used: %s is missing in %s",
                *(self.folder / "oxts", " and ".join(missing), self._above),
            )
            return None
        stamps = _read_dates(self.folder / "oxts" / "timestamps.txt")
        numbers, T_w_imu = read_oxts(self.folder / "oxts" / "data", len(stamps.texts))
        T_camera_imu = self._calibration.T_camera_imu(self._left, raw=self._is_raw_mono)
        return Trajectory(stamps.seconds[numbers], T_w_imu @ np.linalg.inv(T_camera_imu))

    def imu(self) -> ImuSamples | None:
        """Read accelerations and angular rates of ``oxts``; see `RecordedSequence.imu`.

        x points forward, y left, z up. Synchronised drives have 10 samples a second, others 100.
        """
        data = self.folder / "oxts" / "data"
        if not data.is_dir():
            return super().imu()
        stamps = _read_dates(self.folder / "oxts" / "timestamps.txt")
        numbers, readings = read_oxts_imu(data, len(stamps.texts))
        return make_samples(str(data), np.column_stack([stamps.seconds[numbers], readings]))

    # ---- files -----------------------------------------------------------------------------------
    def _camera_folder(self, camera: int) -> Path:
        return self.folder / f"image_{camera:02d}"

    def _list(self, camera: int) -> tuple[Stamps, list[Path]]:
        """Times and images of a camera: line n of the list is the time of image n, from 0."""
        folder = self._camera_folder(camera)
        path = folder / "timestamps.txt"
        stamps = _read_dates(path)
        images = {int(p.stem): p for p in image_files(folder / "data") if p.stem.isdecimal()}
        numbers, n = sorted(images), len(stamps.texts)
        if numbers and numbers[-1] >= n:
            raise DatasetError(
                f"{path} holds {counted(n, 'time stamp')}, but the images in {folder / 'data'} "
                f"have numbers up to {numbers[-1]:010d}; copy the drive's own timestamps.txt there"
            )
        if numbers and len(numbers) < n:
            _log.warning(
                "%s holds %d time stamps, but there are %d images in %s; taking these",
                *(path, n, len(numbers), folder / "data"),
            )
        return _some(stamps, numbers), [images[number] for number in numbers]

    def _files(self, index: int) -> tuple[Path, ...]:
        if self.sensor is Sensor.MONOCULAR:
            return (self._paths[index],)
        return self._paths[index], self._right_paths[index]

    @property
    def _above(self) -> Path:
        return self.folder.resolve().parent

    def _find(self, name: str) -> Path | None:
        """Find a calibration file in the folder of the day, above the drive."""
        places = (self.folder / name, self._above / name)
        return next((path for path in places if path.is_file()), None)

    # ---- calibration -----------------------------------------------------------------------------
    @property
    def _missing_calibration(self) -> str:  # type: ignore[override]
        date = _DATE.match(self.name)
        archive = f"{date[0]}_calib.zip" if date else "the calibration of the day"
        return (
            f"{CAMERAS_FILE} is missing; download {archive} from {_PAGE} and put {CAMERAS_FILE} "
            f"into {self._above}"
        )

    @cached_property
    def _calibration(self) -> DriveCalibration:
        return DriveCalibration({name: self._find(name) for name in DriveCalibration.FILES})

    @cached_property
    def _is_raw(self) -> bool:
        """Return whether images are raw, by their size or else by the name."""
        size = None
        for image in read_sample(self._paths[:1]):
            size = (image.shape[1], image.shape[0])
        raw, rectified = (self._calibration.size(self._left, raw=raw) for raw in (True, False))
        if raw != rectified and size in (raw, rectified):
            return size == raw
        return self.name.endswith("_extract")

    @property
    def _named_cameras(self) -> str:
        if self.sensor is Sensor.STEREO:
            return f"cameras image_{self._left:02d} and image_{self._right:02d}"
        return f"camera image_{self._left:02d}"

    @property
    def _is_raw_mono(self) -> bool:
        return self.sensor is Sensor.MONOCULAR and self._is_raw

    def _from_calibration(self) -> Settings | None:
        self._calibrated_by = self._find(CAMERAS_FILE)
        if self._calibrated_by is None:
            return None
        rate = rate_of(self.timestamps, _USUAL_RATE)
        if self.sensor is Sensor.STEREO:
            pair = (self._left, self._right)
            return self._calibration.stereo_settings(pair, rate, raw=self._is_raw)
        return self._calibration.monocular_settings(self._left, rate, raw=self._is_raw)


def _has_images(folder: Path, camera: int) -> bool:
    data = folder / f"image_{camera:02d}" / "data"
    return data.is_dir() and any(path.stem.isdecimal() for path in image_files(data))


def _some(stamps: Stamps, places: list[int]) -> Stamps:
    texts, lines = (tuple(one[k] for k in places) for one in (stamps.texts, stamps.lines))
    return Stamps(stamps.seconds[places], texts, lines)  # type: ignore[arg-type]


def _read_dates(path: Path) -> Stamps:
    """Read ``2011-09-26 13:02:25.964389445`` lines, as seconds since 1970."""
    lines = content_lines(path)
    texts = []
    for line in lines:
        try:
            date = np.datetime64(" ".join(line.fields), "ns")
            nanoseconds = int(date.astype(np.int64))
            if len(line.fields) != 2 or np.isnat(date):
                raise ValueError
        except ValueError:
            raise DatasetError(
                f"{path}:{line.number}: '{' '.join(line.fields)}' is no date and time such as "
                "2011-09-26 13:02:25.964389445; copy the drive's own timestamps.txt there"
            ) from None
        texts.append(f"{nanoseconds // 10**9}.{nanoseconds % 10**9:09d}")
    return read_clock(path, texts, _USUAL_RATE).stamps([line.number for line in lines])
