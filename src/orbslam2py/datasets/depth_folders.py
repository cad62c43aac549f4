# SPDX-License-Identifier: BSD-3-Clause
"""A folder of images beside a folder of depth images, without any list."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orbslam2py._arguments import index_of
from orbslam2py._depth_size import depth_size_problem
from orbslam2py.datasets.base import Images
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.images import read_any, read_depth
from orbslam2py.datasets.time_files import seconds_of_name, stamps_of_names
from orbslam2py.datasets.unlisted import UnlistedSequence
from orbslam2py.errors import DatasetError, ImageError, OrbSlamError
from orbslam2py.settings import Sensor
from orbslam2py.trajectory import MAX_DIFFERENCE, associate

_log = logging.getLogger(__name__)

#: Names of folders with images of the camera, and with depth: they decide between several.
_COLOUR_NAME = re.compile(r"colou?r|rgb|images?|img|frames?", re.IGNORECASE)
_DEPTH_NAME = re.compile(r"depth", re.IGNORECASE)
#: Least share of the smaller folder that must have a partner of the same name.
_BY_NAME = 0.5


@dataclass(frozen=True)
class FolderKind:
    """The contents of a folder of images, recognised by its first image.

    Attributes
    ----------
    path
        The folder.
    n
        Number of images.
    kind
        ``colour`` (8 bits), ``depth`` (16 bits or floating point, one channel) or ``other``.
    pixels
        Name of its images in messages.
    size
        Width and height of the first one.
    """

    path: Path
    n: int
    kind: str
    pixels: str
    size: tuple[int, int]

    def __str__(self) -> str:
        return f"{self.path.name} ({self.n} images, {self.pixels})"


@dataclass(frozen=True)
class DepthPair:
    """The folder of the images and the folder of their depth."""

    colour: FolderKind
    depth: FolderKind


def folder_kinds(folder: Path) -> list[FolderKind]:
    """Examine the first image of every sub-folder with images.

    Raises
    ------
    DatasetError
        If a folder cannot be listed.
    """
    inner = sorted(child for child in folder.iterdir() if child.is_dir())
    return [_kind_of(child, files) for child in inner if (files := image_files(child))]


def is_depth_name(name: str) -> bool:
    """Return whether the name of a folder suggests depth."""
    return _DEPTH_NAME.search(name) is not None


def find_depth_pair(folder: Path) -> DepthPair | None:
    """Return the two sub-folders with images and depth; None if they are not certain."""
    kinds = folder_kinds(folder)
    colour = _only([one for one in kinds if one.kind == "colour"], _COLOUR_NAME)
    depth = _only([one for one in kinds if one.kind == "depth"], _DEPTH_NAME)
    return None if colour is None or depth is None else DepthPair(colour, depth)


def told_by_names(folder: Path) -> bool:
    """Whether the folder of the images is recognised by its name, also beside other folders."""
    pair = find_depth_pair(folder)
    return pair is not None and _COLOUR_NAME.match(pair.colour.path.name) is not None


def no_depth_pair(folder: Path, kinds: list[FolderKind]) -> DatasetError:
    """Return a message: the contents of a folder without images and depth, and the remedy."""
    has = ", ".join(map(str, kinds))
    alone = ", or give one of these folders alone (--sensor mono)" if len(kinds) > 1 else ""
    only_depth = len(kinds) > 1 and all(one.kind == "depth" for one in kinds)
    if only_depth:
        has += "; all of them look like depth images (16 bits, one channel)"
    return DatasetError(
        f"cannot decide which folder in {folder} has the images and which the depth: it has {has}; "
        "keep one folder of 8-bit images, such as color, and one of 16-bit depth, such as depth, "
        f"or list the files in rgb.txt and depth.txt ('time path' in every line){alone}"
    )


class DepthFolders(UnlistedSequence):
    """Images and depth images in two folders side by side; see `datasets.base.Sequence`.

    The folders are recognised by the first image of each, and by their names if several fit. Images
    and depth images are paired by time if all names are times, else by equal names, else by their
    order if there are as many of both.

    Parameters
    ----------
    folder
        The folder that contains the two folders.
    sensor
        RGB-D or monocular; by default RGB-D.
    settings
        Settings, a file, a built-in name, or None to choose by the folder.
    fps
        Images per second; by default the times in the names, else the rate of the settings.
    times
        File with one time stamp per image.

    Raises
    ------
    DatasetError
        If the folders or the pairs are not clear, or the time stamps do not fit.
    SettingsError
        If the settings are invalid.
    """

    layout = "images and depth"
    _missing_calibration = "its camera is unknown; give --settings with a file or a built-in name"

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
        pair = find_depth_pair(folder)
        if pair is None:
            raise no_depth_pair(folder, folder_kinds(folder))
        super().__init__(folder, (Sensor.RGBD, Sensor.MONOCULAR), sensor, settings)
        self._fps = fps
        images = files_in_time(pair.colour.path)
        self._partners = []
        how = "images alone"
        if self.sensor is Sensor.RGBD:
            _require_equal_view(pair)
            images, self._partners, how = _paired(folder, pair, images)
        self._paths, self._list_path = images, pair.colour.path
        told = self._choose_times(images, times)
        if self._partners:
            _log.info(
                "%s: %d images of %s are paired with depth of %s %s; their times %s",
                *(folder, len(images), pair.colour.path.name, pair.depth.path.name, how, told),
            )

    def load(self, index: int, /) -> Images:
        """Read the images of a frame; see `datasets.base.Sequence.load`."""
        image_path, *depth_path = self._files(index_of(index, len(self)))
        image = self._read(image_path)
        return Images(image, depth=read_depth(depth_path[0])) if depth_path else Images(image)


def _kind_of(folder: Path, files: list[Path]) -> FolderKind:
    try:
        first = read_any(files[0])
    except (OrbSlamError, OSError):  # the run says so when it comes to the image
        return FolderKind(folder, len(files), "other", "not readable", (0, 0))
    size = (int(first.shape[1]), int(first.shape[0]))
    one_channel = first.ndim == 2 or first.shape[2] == 1
    pixels = "floating point" if first.dtype.kind == "f" else f"{8 * first.dtype.itemsize} bits"
    kind = "other"
    if first.dtype == np.uint8:
        kind = "colour"
    elif one_channel and (first.dtype == np.uint16 or first.dtype.kind == "f"):
        kind, pixels = "depth", f"{pixels}, one channel"
    return FolderKind(folder, len(files), kind, pixels, size)


def _only(candidates: list[FolderKind], name: re.Pattern[str]) -> FolderKind | None:
    """Return the single item; of several, the single one with this name."""
    if len(candidates) > 1:
        candidates = [one for one in candidates if name.match(one.path.name)]
    return candidates[0] if len(candidates) == 1 else None


def _require_equal_view(pair: DepthPair) -> None:
    depth, image = (one.size[::-1] for one in (pair.depth, pair.colour))
    problem = None if depth == image else depth_size_problem(depth, image)
    if problem is not None:
        raise ImageError(f"{pair.depth.path} and {pair.colour.path}: {problem}")


def _paired(
    folder: Path, pair: DepthPair, images: list[Path]
) -> tuple[list[Path], list[Path], str]:
    """Return images, the depth of each, and the method of pairing."""
    depths = files_in_time(pair.depth.path)
    colour_stamps, depth_stamps = stamps_of_names(images), stamps_of_names(depths)
    by_name = {path.stem: path for path in depths}
    named = [path for path in images if path.stem in by_name]
    how = "by equal names"
    if colour_stamps and depth_stamps:
        i, j = associate(colour_stamps.seconds, depth_stamps.seconds)
        both = [(images[k], depths[m]) for k, m in zip(i.tolist(), j.tolist(), strict=True)]
        how = f"by times no more than {MAX_DIFFERENCE} s apart"
    elif len(named) >= _BY_NAME * min(len(images), len(depths)):
        both = [(path, by_name[path.stem]) for path in named]
    elif len(images) == len(depths):
        both = list(zip(images, depths, strict=True))
        how = f"in their order ({images[0].name} with {depths[0].name})"
    else:
        both = []
    if not both:
        raise DatasetError(
            f"cannot pair images and depth in {folder}: {pair.colour} and {pair.depth} have "
            "neither equal names nor equal counts; name them alike, or list them in rgb.txt and "
            "depth.txt ('time path' in every line)"
        )
    left_out = len(images) - len(both)
    if left_out:
        _log.warning("%s: %d images have no depth image, left out", pair.colour.path, left_out)
    return [image for image, _ in both], [depth for _, depth in both], how


def files_in_time(folder: Path) -> list[Path]:
    """Return images by their time if their names are times (0.25 before 0.5), else by name."""
    files = image_files(folder)
    if any(seconds_of_name(path.stem) is None for path in files):
        return files
    return sorted(files, key=lambda path: float(seconds_of_name(path.stem) or 0))
