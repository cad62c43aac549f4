# SPDX-License-Identifier: BSD-3-Clause
"""Opens recorded images by the name that a user gives: a folder, a bag or a video."""

from __future__ import annotations

import mimetypes
from collections.abc import Mapping
from pathlib import Path

from orbslam2py._arguments import path_of
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py.datasets.bags import BagSequence
from orbslam2py.datasets.base import IterableSequence
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.depth_folders import find_depth_pair
from orbslam2py.datasets.image_folder import ImageFolder, image_files
from orbslam2py.datasets.images import open_video
from orbslam2py.datasets.masks import MaskedSequence
from orbslam2py.datasets.recognise import (
    has_layout,
    is_recording,
    open_folders,
    open_sequence,
)
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.datasets.rig_folders import RigFolders, is_rig
from orbslam2py.datasets.stereo_folders import find_image_pair, no_pair
from orbslam2py.datasets.video import VideoSequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor

#: Files that belong to a run, but are not its sequence: endings, what they are, their option.
_OTHER_FILES = (
    ((".yaml", ".yml"), "settings", "--settings"),
    ((".orbmap",), "map", "--load"),
)


def open_recorded(
    source: str | Path,
    sensor: Sensor | str | None = None,
    *,
    settings: SettingsChoice = None,
    fps: float | None = None,
    times: str | Path | None = None,
    mask: str | Path | None = None,
    topics: Mapping[str, str] | str | None = None,
    split: bool = False,
) -> IterableSequence:
    """Open a recorded sequence, a bag, a folder of images or a video.

    Parameters
    ----------
    source
        Folder of a sequence in a layout that `open_sequence` knows, folder of images, folder with a
        folder of images and one of depth, or with images of a left and a right camera (two folders,
        or two series of images), bag of ROS 1 or ROS 2 (file or folder), or video file.
    sensor
        The sensor; by default the richest one that there are images for.
    settings
        Settings, a file, a built-in name, or None to choose by the folder.
    fps
        Images per second of a folder of images or a video.
    times
        File with one time stamp for each image of a folder or a video: decimal seconds or whole
        nanoseconds, with or without the names of the images.
    mask
        An image file, with no keypoints where it is 0, or a folder with one for each image.
    topics
        For a bag: the topics of the images, as `BagSequence` takes them.
    split
        Of a folder of images or a video: whether every image holds the left view in its left half
        and the right view in its right half.

    Raises
    ------
    DatasetError
        If there is no such input, or it has no images for the sensor.
    SettingsError
        If there are no settings, or they are invalid.
    ImageError
        If the mask is no readable image.
    """
    named = path_of(source, "what to open")
    if is_recording(named):
        sequence: IterableSequence = BagSequence(named, sensor, settings=settings, topics=topics)
        _refuse_times(named, sequence.layout, fps, times)
        _refuse_split(named, sequence.layout, split)
    else:
        refuse_topics(named, topics)
        sequence = _open_recorded(named, sensor, settings, fps, times, split)
    return sequence if mask is None else MaskedSequence(sequence, mask)


def _open_recorded(
    path: Path,
    sensor: Sensor | str | None,
    settings: SettingsChoice,
    fps: float | None,
    times: str | Path | None,
    split: bool,
) -> IterableSequence:
    if is_rig(path, sensor, settings):
        _refuse_split(path, RigFolders.layout, split)
        return RigFolders(path, sensor, settings=settings, fps=fps, times=times)
    if path.is_file():
        _require_video(path)
        return VideoSequence(path, sensor, settings=settings, fps=fps, times=times, split=split)
    if path.is_dir() and not has_layout(path):
        if image_files(path) and split:
            return ImageFolder(path, sensor, settings=settings, fps=fps, times=times, split=True)
        if split and (find_image_pair(path, wanted=True) or find_depth_pair(path)):
            _refuse_split(path, "a folder with two folders of images", split)
        opened = open_folders(path, sensor, settings, fps, times)
        if opened is not None:
            return _with_images(opened)
        if image_files(path):
            _refuse_half_of_pair(path, sensor)
            return ImageFolder(path, sensor, settings=settings, fps=fps, times=times)
        inner = sorted(child for child in path.iterdir() if child.is_dir() and image_files(child))
        if inner and not any(has_layout(child) for child in path.iterdir()):
            if sensor is not None and Sensor(sensor) is Sensor.STEREO:
                raise no_pair(path)
            raise DatasetError(f"no images in {path} itself; did you mean {inner[0]}?")
    sequence = _with_images(open_sequence(path, sensor, settings=settings))
    _refuse_times(path, sequence.layout, fps, times)
    _refuse_split(path, sequence.layout, split)
    return sequence


def _with_images(sequence: IterableSequence) -> IterableSequence:
    if isinstance(sequence, RecordedSequence):
        sequence.require_images()
    return sequence


def _refuse_split(path: Path, layout: str, split: bool) -> None:
    if split:
        raise DatasetError(
            "--split is for images that hold two views side by side, in a folder of images, a "
            f"video or from a camera; {path} is {layout}: leave it out"
        )


def _refuse_times(path: Path, layout: str, fps: float | None, times: str | Path | None) -> None:
    for name, value in (("--fps", fps), ("--times", times)):
        if value is not None:
            raise DatasetError(
                f"{name} is for a folder of images or a video; {path} is {layout}, "
                "which has its own time stamps"
            )


def refuse_topics(source: object, topics: Mapping[str, str] | str | None) -> None:
    """Raise `DatasetError` if topics are named for something that has none."""
    if topics is not None:
        raise DatasetError(f"--topics is for a bag, which {source} is not; leave it out")


def _require_video(path: Path) -> None:
    """Refuse a file if its name says that it is no video."""
    ending = path.suffix.lower()
    for endings, what, option in _OTHER_FILES:
        if ending in endings:
            raise DatasetError(
                f"{path} is a {what} file: give it with {option}; the sequence comes first"
            )
    kind = mimetypes.guess_type(path.name)[0] or ""
    if ending in IMAGE_SUFFIXES or kind.startswith("video/"):
        return
    # Text is not tried: to OpenCV some of it is a film of characters.
    readable = not kind.startswith("text/") and open_video(path).isOpened()
    if not readable:
        raise DatasetError(
            f"{path} is neither a video, nor a bag, nor a folder, nor a camera; give the folder of "
            "a sequence, a folder of images, a bag, a video or the number of a camera"
        )


def _refuse_half_of_pair(path: Path, sensor: Sensor | str | None) -> None:
    """Name the parent folder if the user gives only one of the two folders."""
    wanted = None if sensor is None else Sensor(sensor)
    here, above = path.resolve(), path.resolve().parent
    if wanted in (None, Sensor.MONOCULAR) or has_layout(above):
        return
    if wanted is Sensor.RGBD:
        pair = find_depth_pair(above)
        if pair is None or here not in (pair.colour.path, pair.depth.path):
            return
        parts = f"images are in {pair.colour.path.name}, depth in {pair.depth.path.name}"
    else:
        sides = None if image_files(above) else find_image_pair(above, wanted=True)
        if sides is None or here.name not in (sides.left, sides.right):
            raise no_pair(path)
        parts = f"left images are in {sides.left}, right ones in {sides.right}"
    raise DatasetError(
        f"{path} holds one half of a pair: {parts}; give the folder of both, {above}"
    )
