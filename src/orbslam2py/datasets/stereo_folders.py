# SPDX-License-Identifier: BSD-3-Clause
"""Images of a left and a right camera without a list: in two folders, or in one."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.depth_folders import FolderKind, files_in_time, folder_kinds, is_depth_name
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.pair_names import find_series, side_of_pair, tells_camera
from orbslam2py.datasets.time_files import stamps_of_names
from orbslam2py.datasets.unlisted import UnlistedSequence
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import Sensor, resolve_settings
from orbslam2py.trajectory import MAX_DIFFERENCE, associate

_log = logging.getLogger(__name__)

#: Least share of the smaller series that must have a partner of the same name or number.
_COMMON = 0.5
#: Layout of a pair, for messages.
A_PAIR = (
    "a pair is two folders of images, such as left and right or cam0 and cam1, or two series in "
    "one folder, such as left_0000.png and right_0000.png; for images that hold both views side "
    "by side take --split of 'orbslam2py run'"
)


@dataclass(frozen=True)
class ImagePair:
    """Images of the left and of the right camera, not yet paired.

    Attributes
    ----------
    folder
        The folder that contains both.
    left, right
        Name of the images in messages.
    left_files, right_files
        The images in their order, by the part of their names without the side.
    """

    folder: Path
    left: str
    right: str
    left_files: dict[str, Path]
    right_files: dict[str, Path]


def find_pair_of_folders(
    kinds: Sequence[FolderKind], *, wanted: bool
) -> tuple[FolderKind, FolderKind] | None:
    """Choose the two folders whose names mean left and right.

    Parameters
    ----------
    kinds
        Folders with images.
    wanted
        Whether the user requests stereo; only then numbers alone (``0`` and ``1``, ``run1`` and
        ``run2``) mean two cameras.
    """
    usable = [one for one in kinds if one.kind != "other" and not is_depth_name(one.path.name)]
    found = [
        (side, left, right)
        for left in usable
        for right in usable
        if (side := side_of_pair(left.path.name, right.path.name)) is not None
        and left.kind == right.kind
        and (wanted or tells_camera(left.path.name, side))
    ]
    if not found:
        return None
    _, left, right = min(found, key=lambda one: (one[0], one[1].path.name))
    return left, right


def find_image_pair(folder: Path, *, wanted: bool = False) -> ImagePair | None:
    """Find images of two cameras in a folder or in its sub-folders; see `find_pair_of_folders`."""
    files = files_in_time(folder)
    if files:
        series = find_series(files)
        if series is None:
            return None
        left, right = (f"{side}*" for side in series.sides)
        return ImagePair(folder, left, right, series.left, series.right)
    pair = find_pair_of_folders(folder_kinds(folder), wanted=wanted)
    if pair is None:
        return None
    one, other = ({path.stem: path for path in files_in_time(kind.path)} for kind in pair)
    return ImagePair(folder, pair[0].path.name, pair[1].path.name, one, other)


def no_pair(folder: Path) -> DatasetError:
    """Return a message: the contents of a folder without a pair, and examples of pairs."""
    files = image_files(folder)
    if files:
        return DatasetError(
            f"{folder} has no stereo images: the names of its {len(files)} images "
            f"({files[0].name} ...) do not name left and right; {A_PAIR}"
        )
    has = ", ".join(map(str, folder_kinds(folder))) or "no images"
    return DatasetError(f"{folder} has no stereo images: it has {has}; {A_PAIR}")


class StereoFolders(UnlistedSequence):
    """Images of a pair of cameras, in two folders or in one; see `datasets.base.Sequence`.

    The two sides are recognised by their names, which differ in left and right, l and r, 0 and 1, 1
    and 2, or 2 and 3. Images are paired by equal names, by times if all names are times, by the
    numbers in their names, or else by their order if there are as many of both.

    Parameters
    ----------
    folder
        The folder that contains both folders or both series.
    sensor
        Stereo or monocular (the left images); by default stereo, or monocular if the given settings
        are of a single camera.
    settings
        Settings, a file, a built-in name, or None for ``settings.yaml`` in the folder. Images are
        rectified if the settings have the calibration of the raw cameras.
    fps
        Images per second; by default the times in the names, else the rate of the settings.
    times
        File with one time stamp per left image.

    Raises
    ------
    DatasetError
        If there is no pair, or its images cannot be paired, or the time stamps do not
        fit.
    SettingsError
        If the settings are invalid.
    """

    layout = "images of a pair"
    _missing_calibration = (
        "their cameras are unknown; give --settings with a file or a built-in name"
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
        wanted = sensor is not None and Sensor(sensor) is Sensor.STEREO
        pair = find_image_pair(folder, wanted=wanted)
        if pair is None:
            raise no_pair(folder)
        doubt = _doubt(pair, settings) if sensor is None else None
        if doubt is not None:
            sensor = Sensor.MONOCULAR
            _log.warning("%s is not taken as a pair: %s", folder, doubt)
        super().__init__(folder, (Sensor.STEREO, Sensor.MONOCULAR), sensor, settings)
        self._fps = fps
        how = ""
        if self.sensor is Sensor.STEREO:
            frames, how = _paired(pair)
            alone = len(pair.left_files) + len(pair.right_files) - 2 * len(frames)
            if alone:
                _log.warning("%s: %d images have no partner, left out", folder, alone)
        else:
            frames = [(name, path, path) for name, path in pair.left_files.items()]
        self._paths = [left for _, left, _ in frames]
        self._partners = [right for _, _, right in frames if self.sensor is Sensor.STEREO]
        told = self._choose_times([Path(name) for name, _, _ in frames], times)
        what = f"taking the {len(frames)} left images alone ({pair.left}, not {pair.right})"
        if self.sensor is Sensor.STEREO:
            what = f"{len(frames)} pairs of {pair.left} and {pair.right}, {how}"
        _log.info("%s: %s; their times %s", folder, what, told)


def _doubt(pair: ImagePair, settings: SettingsChoice) -> str | None:
    """Return why images count as a pair only on request of the user."""
    if _is_of_one_camera(settings, pair.folder):
        return "the settings are of a single camera"
    try:
        _paired(pair)
    except DatasetError as error:
        return str(error).partition(";")[0]
    return None


def _is_of_one_camera(settings: SettingsChoice, folder: Path) -> bool:
    """Return whether settings fit one camera, but not a pair."""
    own = folder / "settings.yaml"
    chosen = own if settings is None and own.is_file() else settings
    if chosen is None:
        return False
    try:
        resolve_settings(chosen, Sensor.STEREO)
    except SettingsError:
        try:
            resolve_settings(chosen, Sensor.MONOCULAR)
        except SettingsError:
            return False
        return True
    return False


def _paired(pair: ImagePair) -> tuple[list[tuple[str, Path, Path]], str]:
    """Return name, left and right image of every frame, and the method of pairing."""
    left, right = pair.left_files, pair.right_files
    names, others = list(left), list(right)
    fewer = min(len(left), len(right))
    stamps = [stamps_of_names([Path(name) for name in one]) for one in (names, others)]
    by_number = _common(_numbers(names), _numbers(others))
    common = [(name, name) for name in names if name in right]
    how = "by equal names"
    if len(common) < _COMMON * fewer:
        if stamps[0] and stamps[1]:
            i, j = associate(stamps[0].seconds, stamps[1].seconds)
            common = [(names[k], others[m]) for k, m in zip(i.tolist(), j.tolist(), strict=True)]
            how = f"by times no more than {MAX_DIFFERENCE} s apart"
        elif len(by_number) >= _COMMON * fewer:
            common, how = by_number, "by the numbers in their names"
        elif len(left) == len(right):
            common = list(zip(names, others, strict=True))
            how = f"in their order ({left[names[0]].name} with {right[others[0]].name})"
        else:
            common = []
    if not common:
        raise DatasetError(
            f"cannot pair the left and the right images in {pair.folder}: {pair.left} "
            f"({len(left)} images) and {pair.right} ({len(right)}) have neither equal names, "
            "times or numbers nor equal counts; name them alike, or take the left ones alone with "
            "--sensor mono"
        )
    return [(name, left[name], right[other]) for name, other in common], how


def _numbers(names: list[str]) -> dict[int, str]:
    """Return names by the last number in them; nothing if two have the same number."""
    found = [re.findall(r"[0-9]+", name) for name in names]
    if not all(found):
        return {}
    numbers = [int(parts[-1]) for parts in found]
    unique = max(Counter(numbers).values(), default=1) == 1
    return dict(zip(numbers, names, strict=True)) if unique else {}


def _common(left: dict[int, str], right: dict[int, str]) -> list[tuple[str, str]]:
    return [(name, right[number]) for number, name in left.items() if number in right]
