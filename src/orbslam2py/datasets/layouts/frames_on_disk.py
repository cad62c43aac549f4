# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of sequences of colour and depth images with a pose for each image."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import index_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.datasets.base import Images, Stamps, require_frames
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.images import read_depth
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import CameraSettings, Sensor, Settings, settings_for_camera
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import nearest_rotations, poses_from

#: A pose whose axes are further from unit length, or from right angles, is none.
_NO_ROTATION = 1e-2
_UNKNOWN = ("nan", "inf", "1.#ind", "1.#qnan", "1.#inf")


class DepthSequence(RecordedSequence):
    """Colour images with registered depth; each layout has a class that lists them.

    Parameters
    ----------
    folder
        The folder of the sequence.
    sensor
        RGB-D or monocular; by default RGB-D if there is depth.
    settings
        Settings, a file, a built-in name, or None for the camera of the data set.
    """

    _missing_calibration = "the camera of the data set is not known; give --settings"

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
    ) -> None:
        folder = Path(folder)
        self._images, self._depths, stamps = self._list(folder)
        whole = len(self._depths) == len(self._images)
        available = (Sensor.RGBD, Sensor.MONOCULAR) if whole else (Sensor.MONOCULAR,)
        super().__init__(folder, available, sensor, settings)
        require_frames(folder, len(self._images))
        self._stamps = stamps

    @abstractmethod
    def _list(self, folder: Path) -> tuple[list[Path], list[Path], Stamps]:
        """Return the images, the depth of each (or none at all), and their times."""

    def image_path(self, index: int, /) -> Path:
        """Return the file of the colour image of a frame."""
        return self._images[index]

    def load(self, index: int, /) -> Images:
        """Read the images of a frame; see `datasets.base.Sequence.load`."""
        index = index_of(index, len(self))
        image: ByteArray = self._read(self._images[index])
        if self.sensor is not Sensor.RGBD:
            return Images(image)
        return Images(image, depth=self._depth(self._depths[index]))

    def _depth(self, path: Path) -> NDArray[np.generic]:
        return read_depth(path)

    def _files(self, index: int) -> tuple[Path, ...]:
        if self.sensor is not Sensor.RGBD:
            return (self._images[index],)
        return self._images[index], self._depths[index]

    def _camera(
        self, numbers: dict[str, float], depth_factor: float, source: Path | None = None
    ) -> Settings:
        """Make settings of the parameters of a camera and the units of its depth per metre."""
        try:
            camera = CameraSettings(**numbers, rgb=True)  # type: ignore[arg-type]
            factor = depth_factor if self.sensor is Sensor.RGBD else None
            return settings_for_camera(camera, self.sensor, depth_factor=factor)
        except (SettingsError, TypeError) as error:
            raise DatasetError(f"{source or self.folder}: {error}") from error


def counted_stamps(numbers: list[int], fps: float) -> Stamps:
    """Make times of numbered images, at a constant rate."""
    texts = tuple(f"{number / fps:.9f}" for number in numbers)
    return Stamps(np.array([float(text) for text in texts]), texts, ())


def read_matrices(path: Path, per_line: int) -> FloatArray:
    """Read poses that are written as matrices, row by row.

    Parameters
    ----------
    path
        The file.
    per_line
        Numbers in every line: 16 (one pose) or 4 (one row).

    Returns
    -------
    FloatArray
        (n, 4, 4); an invalid pose contains NaN.

    Raises
    ------
    DatasetError
        If a line has another count of numbers.
    """
    rows = []
    for line in content_lines(path):
        if len(line.fields) != per_line:
            raise DatasetError(
                f"{path}:{line.number}: expected {per_line} numbers, found {len(line.fields)}"
            )
        # Windows wrote -1.#IND where a pose was not found.
        rows.append(
            [
                np.nan if field.lower().strip("+-") in _UNKNOWN else number_of(path, line, field)
                for field in line.fields
            ]
        )
    numbers = np.array(rows, dtype=np.float64)
    if numbers.size == 0 or numbers.size % 16:
        raise DatasetError(f"{path} holds no whole number of 4 x 4 matrices; copy it again")
    T = numbers.reshape(-1, 4, 4)
    R = T[:, :3, :3]
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = ~np.isfinite(T).all(axis=(1, 2)) | ~(off < _NO_ROTATION)
    safe = np.where(bad[:, None, None], np.eye(4), T)
    poses: FloatArray = poses_from(nearest_rotations(safe[:, :3, :3]), safe[:, :3, 3])
    poses[bad] = np.nan
    return poses


def known_poses(path: Path, seconds: FloatArray, T_wc: FloatArray) -> Trajectory | None:
    """Make a trajectory of the known poses; None if there are none.

    Raises
    ------
    DatasetError
        If the numbers of poses and times differ.
    """
    if len(T_wc) < len(seconds):
        raise DatasetError(
            f"{path} has {len(T_wc)} poses for {len(seconds)} images; copy it again, or take it "
            "away"
        )
    known = np.isfinite(T_wc[: len(seconds)]).all(axis=(1, 2))
    return Trajectory(seconds[known], T_wc[: len(seconds)][known]) if known.any() else None
