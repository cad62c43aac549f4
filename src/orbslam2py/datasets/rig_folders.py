# SPDX-License-Identifier: BSD-3-Clause
"""Images of a rig: a folder with one folder of images for each camera."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arguments import index_of
from orbslam2py.datasets.base import Images, Stamps
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.depth_folders import files_in_time
from orbslam2py.datasets.euroc import ground_truth_of
from orbslam2py.datasets.image_folder import natural_key
from orbslam2py.datasets.images import read_depth
from orbslam2py.datasets.time_files import stamps_of_names
from orbslam2py.datasets.unlisted import UnlistedSequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.settings.rig_file import is_rig_text
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, associate

_log = logging.getLogger(__name__)

_NUMBER = re.compile(r"^(?P<name>.*?)(?P<number>\d+)$")
#: Differences of the stamps of one moment that are worth a warning [s].
_APART = 1e-3
#: Layout of a rig, for messages.
A_RIG = (
    "a rig is a folder with one folder of images for each camera, in the order of the settings: "
    "cam0, cam1, ... (or mav0/cam0/data, ...), and depth0, ... for cameras with depth images; the "
    "images of one moment have the same name, or times as names"
)


def is_rig(folder: Path, sensor: Sensor | str | None, settings: SettingsChoice) -> bool:
    """Return whether a folder is to be read as one of a rig: by the sensor, or by the settings."""
    if not folder.is_dir():
        return False
    if sensor is not None:
        return Sensor(sensor) is Sensor.RIG
    if isinstance(settings, Settings):
        return settings.sensor is Sensor.RIG
    file = folder / "settings.yaml" if settings is None else Path(settings)
    return file.is_file() and is_rig_text(file.read_text("utf-8", errors="replace"))


class RigFolders(UnlistedSequence):
    """Images of a rig, in one folder for each camera; see `datasets.base.Sequence`.

    The names of the folders of the cameras end with numbers: ``cam0``, ``cam1``, ... Depth images
    are in ``depth0``, ``depth1``, ... with the numbers of their cameras. Images of one moment have
    equal names, or times as names, which may differ by less than 0.02 s. A camera may lack images.

    Parameters
    ----------
    folder
        The folder that contains the folders, or its ``mav0``.
    settings
        Settings of a rig, a file, or None for ``settings.yaml`` in the folder.
    fps
        Moments per second; by default the times in the names, else the rate of the settings.
    times
        File with one time stamp for each moment.

    Raises
    ------
    DatasetError
        If there are no such folders, their number is not that of the cameras, or their images do
        not belong together.
    SettingsError
        If the settings are invalid.
    """

    layout = "images of a rig"
    _missing_calibration = (
        "the poses of its cameras are unknown; give --settings with the file of a rig"
    )

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        fps: float | None = None,
        times: str | Path | None = None,
    ) -> None:
        folder = Path(folder)
        super().__init__(folder, (Sensor.RIG,), sensor, settings)
        self._fps = fps
        self._partners = []
        cameras = camera_folders(folder)
        rig = self.settings.rig
        assert rig is not None
        if len(cameras) != len(rig):
            has = ", ".join(path.name for path, _ in cameras) or "none"
            raise DatasetError(
                f"the settings have {len(rig)} cameras, and {folder} has {len(cameras)} folders of "
                f"images ({has}); {A_RIG}"
            )
        series = [{path.stem: path for path in files_in_time(images)} for _, images in cameras]
        self._moments = _moments_of(folder, series)
        self._depths = [
            depths_of(named, self._moments, i) if member.depth else {}
            for i, ((named, _), member) in enumerate(zip(cameras, rig, strict=True))
        ]
        self._paths = [
            next(path for path in moment if path is not None) for moment in self._moments
        ]
        told = self._choose_times(self._paths, times)
        _log.info(
            "%s: %d moments of %d cameras; their times %s",
            folder,
            len(self._moments),
            len(rig),
            told,
        )

    def load(self, index: int, /) -> Images:
        """Read the images of a moment; None for a camera that has none."""
        index = index_of(index, len(self))
        rig = self.settings.rig
        assert rig is not None
        cameras: list[Any] = []
        for i, (path, member) in enumerate(zip(self._moments[index], rig, strict=True)):
            if path is None:
                cameras.append(None)
                continue
            image = self._read(path)
            depth = self._depths[i].get(path.stem)
            has_depth = member.depth and depth is not None
            cameras.append((image, read_depth(depth)) if has_depth and depth else image)
        first = next(one for one in cameras if one is not None)
        return Images(first[0] if isinstance(first, tuple) else first, cameras=tuple(cameras))

    def ground_truth(self) -> Trajectory | None:
        """Read the true poses of the first camera in EuRoC's layout; None if there are none."""
        return ground_truth_of(_root_of(self.folder))

    def _settings_folders(self) -> tuple[Path, ...]:
        return (self.folder, self.folder.parent) if self.folder.name == "mav0" else (self.folder,)


def _root_of(folder: Path) -> Path:
    return folder / "mav0" if (folder / "mav0").is_dir() else folder


def camera_folders(folder: Path) -> list[tuple[Path, Path]]:
    """Find the folders of the cameras, by their numbers, and where their images are."""
    top = _root_of(folder)
    found: dict[str, list[tuple[int, Path]]] = {}
    for child in sorted(top.iterdir(), key=lambda path: natural_key(path.name)):
        named = _NUMBER.match(child.name)
        if named is None or not child.is_dir() or named["name"].lower().startswith("depth"):
            continue
        images = child / "data" if (child / "data").is_dir() else child
        if files_in_time(images):
            found.setdefault(named["name"], []).append((int(named["number"]), child))
    if not found:
        raise DatasetError(f"{folder} has no images of a rig; {A_RIG}")
    most = max(found.values(), key=len)
    paths = [path for _, path in sorted(most)]
    return [(path, path / "data" if (path / "data").is_dir() else path) for path in paths]


def depths_of(camera: Path, moments: list[list[Path | None]], number: int) -> Mapping[str, Path]:
    """Find the depth images of a camera, by the names of its images."""
    named = _NUMBER.match(camera.name)
    assert named is not None
    folder = camera.parent / f"depth{named['number']}"
    folder = folder / "data" if (folder / "data").is_dir() else folder
    files = {path.stem: path for path in files_in_time(folder)} if folder.is_dir() else {}
    images = [moment[number] for moment in moments]
    names = {path.stem for path in images if path is not None}
    if not names & set(files):
        raise DatasetError(
            f"camera {number + 1} has depth images by the settings, and {folder} holds none with "
            f"the names of the images in {camera}; put them there, or leave out "
            f"Camera{number + 1}.depth"
        )
    return files


def _moments_of(folder: Path, series: list[dict[str, Path]]) -> list[list[Path | None]]:
    """The image of every camera for each moment."""
    names = sorted(set().union(*series), key=natural_key)
    complete = [name for name in names if all(name in one for one in series)]
    fewest = min(map(len, series))
    if len(complete) < 0.5 * fewest:
        stamps = [stamps_of_names(list(one.values())) for one in series]
        if any(one is None for one in stamps):
            raise DatasetError(
                f"the images in {folder} do not belong together: their names differ, and are no "
                f"times; {A_RIG}"
            )
        return _by_times(folder, series, [one for one in stamps if one is not None])
    _tell_incomplete(folder, len(names), len(names) - len(complete))
    return [[one.get(name) for one in series] for name in names]


def _by_times(
    folder: Path, series: list[dict[str, Path]], stamps: list[Stamps]
) -> list[list[Path | None]]:
    """Join images whose times differ little, by those of the camera with most images."""
    leading = max(range(len(series)), key=lambda i: len(series[i]))
    moments: list[list[Path | None]] = [[None] * len(series) for _ in series[leading]]
    most_apart = 0.0
    for i, (one, stamp) in enumerate(zip(series, stamps, strict=True)):
        first, second = associate(stamps[leading].seconds, stamp.seconds)
        paths = list(one.values())
        for at, index in zip(first.tolist(), second.tolist(), strict=True):
            moments[at][i] = paths[index]
        if len(first):
            apart = np.abs(stamps[leading].seconds[first] - stamp.seconds[second])
            most_apart = max(most_apart, float(np.median(apart)))
    if most_apart > _APART:
        _log.warning(
            "%s: images of one moment are up to %.1f ms apart; a rig has one pose for each moment, "
            "so motion makes errors: synchronise the cameras, or give images with equal times",
            folder,
            1e3 * most_apart,
        )
    incomplete = sum(any(path is None for path in moment) for moment in moments)
    if incomplete == len(moments):
        raise DatasetError(
            f"the images in {folder} do not belong together: no moment has images of all cameras "
            f"whose times differ by less than {MAX_DIFFERENCE} s; {A_RIG}"
        )
    _tell_incomplete(folder, len(moments), incomplete)
    return moments


def _tell_incomplete(folder: Path, n: int, incomplete: int) -> None:
    if incomplete:
        _log.warning(
            "%s: %d of %d moments lack the image of a camera; the other cameras track on",
            folder,
            incomplete,
            n,
        )
