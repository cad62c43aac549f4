# SPDX-License-Identifier: BSD-3-Clause
"""TUM RGB-D benchmark: ``rgb.txt``, ``depth.txt`` or an association of both."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arguments import index_of
from orbslam2py._text_lines import TextLine, content_lines
from orbslam2py.datasets.base import Images, Layout, Stamps, require_frames
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.clock import Clock, is_time, read_clock, time_of
from orbslam2py.datasets.images import read_depth
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory, associate, read_tum

_log = logging.getLogger(__name__)

#: Possible names of an association file; the first existing one is used.
ASSOCIATION_NAMES = ("associations.txt", "association.txt", "associate.txt", "assoc.txt")


@dataclass(frozen=True)
class ImageList:
    """Images that a file lists, with their time stamps.

    Attributes
    ----------
    stamps
        When each was taken.
    paths
        Their files, as in the list: relative to the folder of the list.
    """

    stamps: Stamps
    paths: tuple[str, ...]


class TumSequence(RecordedSequence):
    """A sequence in the layout of the TUM RGB-D benchmark; see `datasets.base.Sequence`.

    Parameters
    ----------
    folder
        The folder with ``rgb.txt``.
    sensor
        Monocular or RGB-D; by default RGB-D if there is depth.
    settings
        Settings, a file, a built-in name, or None to choose by the folder.
    association
        Lines ``t_rgb path_rgb t_depth path_depth``. By default a file of the usual names in the
        folder, else colour and depth images are associated by their time stamps.

    Raises
    ------
    DatasetError
        The message names the file, and the line if a list is malformed.
    SettingsError
        If the settings are invalid.
    """

    layout = Layout.TUM
    up_in_truth = np.array([0.0, 0.0, 1.0])  # the motion capture system stands upright
    _missing_calibration = (
        "its name does not identify the camera; for TUM RGB-D give --settings tum1 (if the "
        "sequence was named freiburg1 there), tum2 (freiburg2) or tum3 (freiburg3)"
    )

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        association: str | Path | None = None,
    ) -> None:
        folder = Path(folder)
        found = Path(association) if association is not None else find_association(folder)
        has_depth = found is not None or (folder / "depth.txt").is_file()
        available = (Sensor.RGBD, Sensor.MONOCULAR) if has_depth else (Sensor.MONOCULAR,)
        super().__init__(folder, available, sensor, settings)
        self._depth_paths: tuple[str, ...] | None = None
        fps = self.known_rate()
        if self.sensor is Sensor.RGBD:
            source = found or self.folder / "rgb.txt"
            colour, self._depth_paths = (
                _read_association(found, fps) if found else _associate_lists(self.folder, fps)
            )
        elif (self.folder / "rgb.txt").is_file() or found is None:
            source = self.folder / "rgb.txt"
            colour = read_image_list(source, fps)
        else:
            source = found
            colour, _ = _read_association(found, fps)
        require_frames(source, len(colour.paths))
        self._list_path = source
        self._colour_paths, self._stamps = colour.paths, colour.stamps

    def image_path(self, index: int, /) -> Path:
        """Return the file of the colour image of a frame."""
        return self.folder / self._colour_paths[index]

    def load(self, index: int, /) -> Images:
        """Read the images of a frame; see `datasets.base.Sequence.load`."""
        image_path, *depth_path = self._files(index_of(index, len(self)))
        image = self._read(image_path)
        return Images(image, depth=read_depth(depth_path[0])) if depth_path else Images(image)

    def _files(self, index: int) -> tuple[Path, ...]:
        if self._depth_paths is None:
            return (self.image_path(index),)
        return self.image_path(index), self.folder / self._depth_paths[index]

    def ground_truth(self) -> Trajectory | None:
        """Read ``groundtruth.txt``; see `datasets.base.Sequence.ground_truth`."""
        path = self.folder / "groundtruth.txt"
        return read_tum(path) if path.is_file() else None


def find_association(folder: Path) -> Path | None:
    """Return the association file of a folder, None if there is none."""
    found = [folder / name for name in ASSOCIATION_NAMES if (folder / name).is_file()]
    if len(found) > 1:
        _log.info("several association files, using %s", found[0])
    return found[0] if found else None


def read_image_list(path: Path, fps: float | None = None) -> ImageList:
    """Read ``time path`` lines; everything after the first blank is the path.

    Parameters
    ----------
    path
        The list.
    fps
        Images per second by the settings, if they are known.

    Raises
    ------
    DatasetError
        Naming file and line.
    """
    lines = content_lines(path)
    for line in lines:
        if len(line.fields) < 2:
            raise DatasetError(f"{path}:{line.number}: expected 'timestamp path', found 1 field")
    clock = _clock(path, lines, 0, fps)
    return ImageList(
        clock.stamps([line.number for line in lines]),
        _found_here(path, [" ".join(lines[place].fields[1:]) for place in clock.order]),
    )


def _read_association(path: Path, fps: float | None) -> tuple[ImageList, tuple[str, ...]]:
    lines = content_lines(path)
    pairs = [_split_association(path, line) for line in lines]
    clock = _clock(path, lines, 0, fps)
    first = _found_here(path, [pairs[place][0] for place in clock.order])
    second = _found_here(path, [pairs[place][1] for place in clock.order])
    if first and _is_depth_first(path.parent, first[0], second[0]):
        _log.warning("%s: the depth images stand first, the colour images second", path)
        first, second = second, first
    return ImageList(clock.stamps([line.number for line in lines]), first), second


def _clock(path: Path, lines: list[TextLine], field: int, fps: float | None) -> Clock:
    for line in lines:
        time_of(path, line, line.fields[field])
    return read_clock(path, [line.fields[field] for line in lines], fps)


def _split_association(path: Path, line: TextLine) -> tuple[str, str]:
    """Split ``time path time path``, whose paths may contain spaces."""
    fields = line.fields
    between = [k for k in range(2, len(fields) - 1) if is_time(fields[k])]
    if not between:
        raise DatasetError(
            f"{path}:{line.number}: expected 't_rgb path_rgb t_depth path_depth', found "
            f"{len(fields)} fields"
        )
    return " ".join(fields[1 : between[0]]), " ".join(fields[between[0] + 1 :])


def _is_depth_first(folder: Path, first: str, second: str) -> bool:
    """Return whether the first image of an association is depth, by names or pixels."""
    names = [Path(one).parent.name.lower() or Path(one).name.lower() for one in (first, second)]
    tells = ["depth" in name for name in names]
    if tells[0] != tells[1]:
        return tells[0]
    pixels = [cv2.imread(str(folder / one), cv2.IMREAD_UNCHANGED) for one in (first, second)]
    is_deep = [
        image is not None and image.ndim == 2 and image.dtype != np.uint8 for image in pixels
    ]
    return is_deep == [True, False]


def _found_here(source: Path, listed: list[str]) -> tuple[str, ...]:
    """Return the paths of a list relative to its folder.

    A list from another computer may have paths that do not exist here; then their last parts are
    used.
    """
    folder = source.parent
    if not listed or (folder / listed[0]).exists():
        return tuple(listed)
    parts = [_parts_of(one) for one in listed]
    for count in range(len(parts[0]), 0, -1):
        if (folder / Path(*parts[0][-count:])).exists():
            _log.warning(
                "%s names its images by paths of another computer; %s is taken for %s",
                *(source, Path(*parts[0][-count:]), listed[0]),
            )
            return tuple(str(Path(*one[-count:])) for one in parts)
    return tuple(listed)


def _parts_of(path: str) -> list[str]:
    """Split a path of any operating system, without its root."""
    return [part for part in re.split(r"[/\\\\]+", path) if part and not part.endswith(":")]


def _associate_lists(folder: Path, fps: float | None) -> tuple[ImageList, tuple[str, ...]]:
    colour = read_image_list(folder / "rgb.txt", fps)
    depth = read_image_list(folder / "depth.txt", fps)
    require_frames(folder / "rgb.txt", len(colour.paths))
    require_frames(folder / "depth.txt", len(depth.paths))
    i, j = associate(colour.stamps.seconds, depth.stamps.seconds)
    if not len(i):
        raise DatasetError(
            f"{folder}: no colour and depth image lie within {MAX_DIFFERENCE} s of each other"
        )
    left_out = len(colour.paths) - len(i)
    if left_out:
        _log.warning("%s: %d colour images have no depth image, left out", folder, left_out)
    stamps = Stamps(
        colour.stamps.seconds[i],
        tuple(colour.stamps.texts[k] for k in i),
        tuple(colour.stamps.lines[k] for k in i),
        (*colour.stamps.doubts, *depth.stamps.doubts),
    )
    paired = ImageList(stamps, tuple(colour.paths[k] for k in i))
    return paired, tuple(depth.paths[k] for k in j)
