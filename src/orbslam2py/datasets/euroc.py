# SPDX-License-Identifier: BSD-3-Clause
"""EuRoC MAV: ``mav0/cam0``, ``mav0/cam1`` with ``data.csv``, ``sensor.yaml`` and ``data/``."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py._text_lines import content_lines
from orbslam2py.datasets.base import Layout, Stamps, require_frames
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.clock import read_clock, text_of
from orbslam2py.datasets.euroc_calibration import (
    monocular_settings,
    read_sensor_yaml,
    stereo_settings,
)
from orbslam2py.datasets.imu import ImuSamples
from orbslam2py.datasets.imu_csv import read_imu_csv
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.datasets.rectification import Rectifier
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import (
    ImuSettings,
    Sensor,
    Settings,
    StereoRectification,
    read_imu_settings,
)
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, associate, read_euroc

_log = logging.getLogger(__name__)

#: Images per second if no calibration contains the rate.
_USUAL_RATE = 20.0
#: Names of images whose usual step is at most this are counts of frames and no times.
_LARGEST_COUNT = 1000


def find_root(folder: Path) -> Path | None:
    """Return the folder of ``cam0``: the given one or its ``mav0``; None if there is none."""
    for root in (folder / "mav0", folder):
        if (root / "cam0" / "data").is_dir() or (root / "cam0" / "data.csv").is_file():
            return root
    return None


@dataclass(frozen=True)
class _CameraList:
    """Return image files in the order of time [ns], with their positions in the list."""

    source: Path
    nanoseconds: tuple[int, ...]
    texts: tuple[str, ...]
    paths: list[Path]
    lines: list[int]
    doubts: tuple[str, ...]

    def since(self, first: int) -> FloatArray:
        """Return times [s] relative to a moment: small numbers keep all digits."""
        return np.array([time - first for time in self.nanoseconds], dtype=np.int64) / 1e9


class EurocSequence(RecordedSequence):
    """A sequence in the layout of the EuRoC MAV data set; see `datasets.base.Sequence`.

    Stereo pairs are rectified by the settings: ``LEFT.*`` and ``RIGHT.*`` of a settings file, the
    built-in ``euroc``, or the cameras' ``sensor.yaml``.

    Parameters
    ----------
    folder
        The folder of the sequence or its ``mav0``.
    sensor
        Monocular (``cam0`` unrectified) or stereo; by default stereo if there is ``cam1``.
    settings
        Settings, a file, a built-in name, or None to choose by the folder.

    Raises
    ------
    DatasetError
        The message names the file, and the line if a list is malformed.
    SettingsError
        If the settings are invalid, or have no rectification for stereo.
    """

    layout = Layout.EUROC
    up_in_truth = np.array([0.0, 0.0, 1.0])  # as the laser tracker and the IMU see gravity
    _missing_calibration = (
        "sensor.yaml is missing in cam0, or for stereo in cam1; copy it there from the data set, "
        "or for EuRoC's own cameras give --settings euroc"
    )

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
    ) -> None:
        folder = Path(folder)
        root = find_root(folder)
        if root is None:
            raise DatasetError(f"{folder} has neither mav0/cam0 nor cam0 with images")
        self._root = root
        has_right = has_camera(root, "cam1")
        available = (Sensor.STEREO, Sensor.MONOCULAR) if has_right else (Sensor.MONOCULAR,)
        super().__init__(folder, available, sensor, settings)
        if self.name == "mav0":
            self.name = folder.resolve().parent.name
        if self._chosen is not None and self._rectifies:
            _ = self._rectification  # fails early if the chosen settings have none
        rate = self.known_rate() or _USUAL_RATE
        left = _list_images(root / "cam0", rate)
        kept = np.arange(len(left.paths))
        self._right: list[Path] = []
        doubts = left.doubts
        if self.sensor is Sensor.STEREO:
            right = _list_images(root / "cam1", rate)
            kept, partners, apart = _pair(root, left, right)
            doubts = (*doubts, *right.doubts, *apart)
            self._right = [right.paths[place] for place in partners]
        require_frames(left.source, len(kept))
        self._list_path = left.source
        self._left = [left.paths[place] for place in kept]
        self._stamps = Stamps(
            np.array([left.nanoseconds[place] / 1e9 for place in kept], dtype=np.float64),
            tuple(left.texts[place] for place in kept),
            tuple(left.lines[place] for place in kept),
            doubts,
        )

    def image_path(self, index: int, /) -> Path:
        """Return the file of the left image of a frame."""
        return self._left[index]

    def _files(self, index: int) -> tuple[Path, ...]:
        if self.sensor is Sensor.MONOCULAR:
            return (self._left[index],)
        return self._left[index], self._right[index]

    def ground_truth(self) -> Trajectory | None:
        """Read the body's poses and move them to the left camera, rectified if it is.

        See `datasets.base.Sequence.ground_truth`. None also if ``cam0/sensor.yaml`` is missing or
        has no ``T_BS``, because the pose of the camera on the vehicle is then unknown.
        """
        truth = ground_truth_of(self._root)
        if truth is None or not self._rectifies:
            return truth
        rectification = self._rectification
        # R of the rectification turns raw into rectified coordinates.
        T_raw_rectified = np.eye(4)
        T_raw_rectified[:3, :3] = rectification.left.R.T
        return Trajectory(truth.timestamps, truth.T_wc @ T_raw_rectified)

    def imu(self) -> ImuSamples | None:
        """Read ``imu0/data.csv``; see `RecordedSequence.imu`."""
        path = self._root / "imu0" / "data.csv"
        return read_imu_csv(path) if path.is_file() else super().imu()

    def imu_settings(self) -> ImuSettings | None:
        """Read ``sensor.yaml`` of IMU and left camera; see `RecordedSequence.imu_settings`."""
        paths = [self._root / name / "sensor.yaml" for name in ("imu0", "cam0")]
        if all(path.is_file() for path in paths):
            return read_imu_settings(*paths)
        return super().imu_settings()

    @cached_property
    def _rectifiers(self) -> tuple[Rectifier, Rectifier] | None:
        if not self._rectifies:
            return None
        rectification = self._rectification
        return Rectifier(rectification.left), Rectifier(rectification.right)

    @property
    def _rectifies(self) -> bool:
        """Whether images are rectified: those of a fisheye pair stay as they are."""
        return self.sensor is Sensor.STEREO and self.settings.right is None

    @property
    def _rectification(self) -> StereoRectification:
        if self.settings.rectification is None:  # of a fisheye pair there is none
            raise SettingsError(
                f"calibration parameters to rectify stereo are missing for {self.folder}: add "
                "LEFT.* and RIGHT.* to the settings, use the built-in 'euroc', or give no settings "
                "to use sensor.yaml"
            )
        return self.settings.rectification

    def _settings_folders(self) -> tuple[Path, ...]:
        return (self.folder, self._root)

    def _from_calibration(self) -> Settings | None:
        paths = [self._root / "cam0" / "sensor.yaml"]
        if self.sensor is Sensor.STEREO:
            paths.append(self._root / "cam1" / "sensor.yaml")
        if not all(path.is_file() for path in paths):
            return None
        cameras = [read_sensor_yaml(path) for path in paths]
        try:
            if self.sensor is Sensor.STEREO:
                return stereo_settings(*cameras)
            return monocular_settings(cameras[0])
        except SettingsError as error:
            raise DatasetError(f"{paths[0]}: {error}") from error


def has_camera(root: Path, camera: str) -> bool:
    """Return whether a camera has images."""
    return (root / camera / "data").is_dir()


def _pair(
    root: Path, left: _CameraList, right: _CameraList
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], list[str]]:
    """Pair images by the nearest time, at most half a step apart, and report doubts."""
    first = left.nanoseconds[0] if left.nanoseconds else 0
    times, others = left.since(first), right.since(first)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 2 * MAX_DIFFERENCE
    limit = min(MAX_DIFFERENCE, step / 2)
    i, j = associate(times, others, limit)
    alone = len(times) + len(others) - 2 * len(i)
    if not len(i) and left.paths:
        raise DatasetError(
            f"{root}: no images of cam0 and cam1 were taken within {limit * 1e3:.3g} ms of each "
            "other; see whether both lists are of one recording"
        )
    doubts = [f"{root}: {alone} images have no partner, left out"] if alone else []
    worst = float(np.abs(times[i] - others[j]).max(initial=0.0))
    if worst > 0:
        doubts.append(f"{root}: images of a pair were taken up to {worst * 1e3:.3g} ms apart")
    for doubt in doubts:
        _log.warning("%s", doubt)
    return i, j, doubts


def _list_images(camera: Path, rate: float) -> _CameraList:
    source = camera / "data.csv"
    if not source.is_file():
        return _list_folder(camera / "data", rate)
    listed: dict[str, tuple[Path, int]] = {}
    for line in content_lines(source, separator=","):
        text = line.fields[0]
        if not text.isdigit():
            raise DatasetError(f"{source}:{line.number}: '{text}' is not a time stamp in ns")
        if text in listed:
            _log.warning("%s:%d: time stamp %s is there twice, left out", source, line.number, text)
            continue
        name = line.fields[1] if len(line.fields) > 1 else ""
        path = camera / "data" / name if name else _guess_path(camera, text)
        listed[text] = path, line.number
    clock = read_clock(source, list(listed), rate, usual_unit=9)
    found = list(listed.values())
    return _CameraList(
        source,
        clock.nanoseconds,
        tuple(map(text_of, clock.nanoseconds)),
        [found[place][0] for place in clock.order],
        [found[place][1] for place in clock.order],
        clock.doubts,
    )


def _guess_path(camera: Path, stamp: str) -> Path:
    candidates = [camera / "data" / (stamp + suffix) for suffix in IMAGE_SUFFIXES]
    return next((path for path in candidates if path.is_file()), candidates[0])


def _list_folder(folder: Path, rate: float) -> _CameraList:
    """Return images of copies without ``data.csv``: their names are time stamps or numbers."""
    if not folder.is_dir():
        raise DatasetError(f"cannot open {folder}: no such folder")
    found = sorted(
        (int(path.stem), path)
        for path in folder.iterdir()
        if path.suffix.lower() in IMAGE_SUFFIXES and path.stem.isdigit() and not path.is_dir()
    )
    numbers = [number for number, _ in found]
    paths = [path for _, path in found]
    if len(numbers) > 1 and np.median(np.diff(numbers)) <= _LARGEST_COUNT:
        doubt = f"{folder}: the names of the images are no times; they count frames at {rate:g} Hz"
        _log.warning("%s", doubt)
        times = tuple(round((number - numbers[0]) * 1e9 / rate) for number in numbers)
        doubts: tuple[str, ...] = (doubt,)
    else:
        clock = read_clock(folder, [path.stem for path in paths], rate, usual_unit=9)
        times, doubts = clock.nanoseconds, clock.doubts
    lines = list(range(1, len(paths) + 1))
    return _CameraList(folder, times, tuple(map(text_of, times)), paths, lines, doubts)


def ground_truth_of(root: Path) -> Trajectory | None:
    """Read the poses of the body in a ``mav0``, and move them to the raw camera ``cam0``.

    None if there are none, or it is unknown where the camera is on the body.
    """
    path = root / "state_groundtruth_estimate0" / "data.csv"
    if not path.is_file():
        path = root / "mocap0" / "data.csv"  # TUM-VI: of the IMU, which is the body
    if not path.is_file():
        return None
    calibration = root / "cam0" / "sensor.yaml"
    if not calibration.is_file():
        _log.warning("%s is not used: %s with T_BS is missing", path, calibration)
        return None
    sensor = read_sensor_yaml(calibration)
    if sensor.T_body_camera is None:
        _log.warning("%s is not used: %s has no T_BS", path, calibration)
        return None
    body = read_euroc(path)
    return Trajectory(body.timestamps, body.T_wc @ sensor.T_BS)
