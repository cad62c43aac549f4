# SPDX-License-Identifier: BSD-3-Clause
"""The layout of a folder, recognised by its files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orbslam2py._arguments import path_of
from orbslam2py.datasets.bags import BagSequence, is_bag
from orbslam2py.datasets.base import IterableSequence, Layout
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.depth_folders import (
    DepthFolders,
    find_depth_pair,
    folder_kinds,
    no_depth_pair,
)
from orbslam2py.datasets.euroc import EurocSequence, find_root
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.kitti import KittiSequence, find_cameras
from orbslam2py.datasets.layouts import Loader, find_loaders, loader_of
from orbslam2py.datasets.rig_folders import RigFolders, is_rig
from orbslam2py.datasets.stereo_folders import StereoFolders, find_image_pair
from orbslam2py.datasets.tum import TumSequence, find_association
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor

_BAGS = (Layout.ROSBAG1, Layout.ROSBAG2, Layout.MCAP)
_MARKS = (
    "rgb.txt or associations.txt (TUM), times.txt with image_0 or image_2 (KITTI), "
    "mav0/cam0 or cam0 (EuRoC), and those of KITTI raw, ICL-NUIM, 7-Scenes, "
    "Bonn, Replica and OpenLORIS"
)


def recognise(folder: str | Path) -> Layout | str:
    """Return the layout of a recorded sequence by the files in its folder.

    Parameters
    ----------
    folder
        The sequence; for EuRoC also its ``mav0``.

    Returns
    -------
    Layout or str
        The name of the entry point if the loader of another package recognises it.

    Raises
    ------
    DatasetError
        If the folder is missing, fits no layout, or several.
    """
    folder = path_of(folder, "the folder of the sequence")
    if not folder.exists():
        raise DatasetError(
            f"{folder} does not exist; give the folder of a sequence, a folder of images, a "
            "video or "
            "the number of a camera"
        )
    if not folder.is_dir():
        raise DatasetError(f"{folder} is no folder; give the folder of a sequence")
    found = _layouts(folder)
    if len(found) > 1:
        raise _several(folder, list(map(str, found)))
    if found:
        return found[0]
    message = f"{folder} is no known sequence: looked for {_MARKS}"
    inner = sorted(child for child in folder.iterdir() if child.is_dir() and _layouts(child))
    if inner:
        message += f"; did you mean {inner[0]}?"
    else:
        message += "; give the folder in which these lie"
    raise DatasetError(message)


def has_layout(folder: Path) -> bool:
    """Return whether a folder has no layout, but a folder of images and a folder of depth."""
    return folder.is_dir() and bool(_layouts(folder))


def is_depth_pair(folder: Path, sensor: Sensor | str | None) -> bool:
    """Return whether a folder has no known layout, but a folder of images and a folder of depth.

    Raises
    ------
    DatasetError
        If RGB-D is requested, or there is depth, and the choice of folders is not clear.
    """
    if not folder.is_dir() or has_layout(folder):
        return False
    if find_depth_pair(folder) is not None:
        return True
    kinds = folder_kinds(folder)
    has_depth = sensor is None and any(kind.kind == "depth" for kind in kinds)
    wants_depth = sensor is not None and Sensor(sensor) is Sensor.RGBD
    meant = has_depth or (wants_depth and bool(kinds))
    if meant and not any(has_layout(child) for child in folder.iterdir()):
        raise no_depth_pair(folder, kinds)
    return False


def open_folders(
    folder: Path,
    sensor: Sensor | str | None,
    settings: SettingsChoice,
    fps: float | None = None,
    times: str | Path | None = None,
) -> IterableSequence | None:
    """Open images without a list, with depth or of a pair; None if there are no such images.

    Raises
    ------
    DatasetError
        If RGB-D or stereo is requested, or there is depth, and the choice is not clear.
    SettingsError
        If there are no settings, or they are invalid.
    """
    if not folder.is_dir() or has_layout(folder):
        return None
    wanted = None if sensor is None else Sensor(sensor)
    given: dict[str, Any] = {"settings": settings, "fps": fps, "times": times}
    pair = None
    if wanted is not Sensor.RGBD and not (wanted is None and find_depth_pair(folder)):
        pair = find_image_pair(folder, wanted=wanted is Sensor.STEREO)
    if pair is not None and not (wanted is Sensor.MONOCULAR and find_depth_pair(folder)):
        return StereoFolders(folder, sensor, **given)
    if not image_files(folder) and is_depth_pair(folder, sensor):
        return DepthFolders(folder, sensor, **given)
    return None


def open_sequence(
    folder: str | Path,
    sensor: Sensor | str | None = None,
    *,
    settings: SettingsChoice = None,
    association: str | Path | None = None,
    layout: Layout | str | None = None,
    topics: Mapping[str, str] | str | None = None,
) -> IterableSequence:
    """Open the sequence in a folder or a bag, recognised by its files.

    Parameters
    ----------
    folder
        One of: TUM RGB-D, KITTI odometry or a drive of KITTI raw, EuRoC (the sequence or its
        ``mav0``), ICL-NUIM, 7-Scenes, Bonn, Replica or OpenLORIS; a layout of another package; a
        folder with images and depth in two folders; a folder with images of a left and a right
        camera (two folders or two series); a bag of ROS 1 or ROS 2 (a file, or the folder of a
        recording).
    sensor
        The sensor; by default the richest one that the folder has images for.
    settings
        Settings, a file, a built-in name, or None to choose by the folder when they are needed.
    association
        Association file of a TUM sequence; by default one in the folder, else by time stamps.
    layout
        The layout, if it should not be recognised; also the name of an entry point.
    topics
        For a bag: the topics of the images, as `datasets.BagSequence` takes them.

    Returns
    -------
    IterableSequence
        A `RecordedSequence`, a `BagSequence`, or the sequence of another package's loader; images
        are read on request.

    Raises
    ------
    DatasetError
        If the folder is no sequence, its lists are malformed, or it has no images for the sensor.
    SettingsError
        If the settings given are wrong.
    """
    folder = path_of(folder, "the folder of the sequence")
    if association is not None:
        association = path_of(association, "association")
    if layout is None and is_rig(folder, sensor, settings):
        return RigFolders(folder, sensor, settings=settings)
    loader = None if layout is None else loader_of(str(layout))
    layout = None if layout is None or loader is not None else Layout(layout)
    if layout in _BAGS or (layout is None and loader is None and is_recording(folder)):
        return BagSequence(folder, sensor, settings=settings, topics=topics)
    if topics is not None:
        raise DatasetError(f"topics belong to a bag; {folder} is none: leave out --topics")
    if layout is None and association is None:
        loader = loader or _one_of(folder, find_loaders(folder))
    if loader is not None:
        return loader(folder, sensor, settings=settings)
    if layout is None and association is None:
        opened = open_folders(folder, sensor, settings)
        if opened is not None:
            return opened
    layout = layout or Layout(recognise(folder))
    if layout is Layout.TUM:
        return TumSequence(folder, sensor, settings=settings, association=association)
    if association is not None:
        raise DatasetError(f"an association file belongs to a TUM sequence; {folder} is {layout}")
    kind = KittiSequence if layout is Layout.KITTI else EurocSequence
    return kind(folder, sensor, settings=settings)


def is_recording(path: Path) -> bool:
    """Return whether a path is a bag, and no folder of images beside a bag."""
    return is_bag(path) and not (path.is_dir() and (_layouts(path) or image_files(path)))


def _one_of(folder: Path, loaders: dict[str, Loader]) -> Loader | None:
    if len(loaders) > 1:
        raise _several(folder, sorted(loaders))
    return next(iter(loaders.values()), None)


def _several(folder: Path, names: list[str]) -> DatasetError:
    return DatasetError(
        f"{folder} looks like several layouts ({', '.join(names)}); name the one you mean"
    )


def _layouts(folder: Path) -> list[Layout | str]:
    # Layouts with unmistakable files come before layouts that only have lists like TUM's.
    special = find_loaders(folder)
    known = {str(layout) for layout in Layout}
    found: list[Layout | str] = [Layout(name) if name in known else name for name in special]
    if found:
        return found
    if (folder / "rgb.txt").is_file() or find_association(folder) is not None:
        found.append(Layout.TUM)
    if (folder / "times.txt").is_file() and find_cameras(folder):
        found.append(Layout.KITTI)
    if find_root(folder) is not None:
        found.append(Layout.EUROC)
    return found
