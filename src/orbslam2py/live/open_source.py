# SPDX-License-Identifier: BSD-3-Clause
"""Opens images by the name that a user gives: a live source, or something recorded."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from orbslam2py._arguments import is_whole, path_of
from orbslam2py.datasets.base import IterableSequence, LiveSource
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.masks import MaskedCamera
from orbslam2py.datasets.recorded_input import open_recorded, refuse_topics
from orbslam2py.errors import DatasetError
from orbslam2py.live.camera import LiveCamera, requested_size
from orbslam2py.live.device import Request
from orbslam2py.live.registry import Kind, kind_of
from orbslam2py.live.stream import LiveStream
from orbslam2py.settings import Sensor, resolve_settings


def open_source(
    source: str | Path | int,
    sensor: Sensor | str | None = None,
    *,
    settings: SettingsChoice = None,
    fps: float | None = None,
    times: str | Path | None = None,
    mask: str | Path | None = None,
    topics: Mapping[str, str] | str | None = None,
    split: bool = False,
    imu: bool = False,
) -> IterableSequence | LiveSource:
    """Open a live source, a recorded sequence, a bag, a folder of images or a video.

    Parameters
    ----------
    source
        A live source: ``realsense:`` or ``realsense:SERIAL``, ``oak:`` or ``oak:ID``, ``v4l:0``,
        ``rtsp://HOST/PATH``, ``ros2:``, ``zenoh:``, the number of a camera (also as text); or any
        input of `orbslam2py.datasets.open_recorded`. A file of that name goes first.
    sensor
        What to deliver images for; by default the richest there is.
    settings
        Settings, a file or a built-in name; by default those of the device or the folder.
    fps
        Images per second of a folder of images or a video; the rate a device is asked for.
    times
        File with one time stamp per image of a folder of images or a video.
    mask
        An image file, 0 where no keypoint may lie, or a folder with one per image.
    topics
        Of a bag or a robot: which topics are the images.
    split
        Of a folder of images, a video or a camera: whether every image holds the left view in its
        left half and the right view in its right half.
    imu
        Of a live source: whether frames come with samples of the IMU.

    Returns
    -------
    IterableSequence or LiveSource
        For a live input a `LiveSource` that has been started.

    Raises
    ------
    DatasetError
        If the input does not exist, is in use or not allowed, its package is not installed, or it
        has no images for the sensor.
    SettingsError
        If there are no settings, or they are wrong.
    ImageError
        If the mask is no readable image.

    Examples
    --------
    >>> for frame in orb.open_source("realsense:", "stereo"):  # doctest: +SKIP
    ...     slam.track(frame.images, frame.timestamp)
    """
    if is_whole(source) and int(str(source)) < 0:
        raise DatasetError(f"there is no camera {source}; cameras are numbered from 0")
    text = str(source)
    is_number = is_whole(source) or text.isdecimal()
    is_there = not is_whole(source) and path_of(source, "what to open").exists()
    named = None if is_number or is_there else kind_of(text)
    if not (is_number or named) or is_there:
        return open_recorded(
            *(path_of(source, "what to open"), sensor),
            settings=settings,
            fps=fps,
            times=times,
            mask=mask,
            topics=topics,
            split=split,
        )
    if times is not None:
        raise DatasetError(
            "--times does not go with a camera: its images get their own times; leave it out"
        )
    if named is None:
        refuse_topics(source, topics)
        _refuse_imu(f"camera {text}", imu)
        stream: LiveStream = LiveCamera(int(text), sensor, settings=settings, fps=fps, split=split)
    else:
        kind, address = named
        stream = _open_kind(kind, address, sensor, settings, fps, topics, split, imu)
    live: LiveSource = stream if mask is None else MaskedCamera(stream, mask)
    live.open()
    return live


def _open_kind(
    kind: Kind,
    address: str,
    sensor: Sensor | str | None,
    settings: SettingsChoice,
    fps: float | None,
    topics: Mapping[str, str] | str | None,
    split: bool,
    imu: bool,
) -> LiveStream:
    if not kind.has_topics:
        refuse_topics(kind.prefix + ":", topics)
    wanted = None if sensor is None else Sensor(sensor)
    if split and wanted is None:
        wanted = Sensor.STEREO
    if settings is not None:
        usual = kind.sensors[0] if wanted is None else wanted
        settings = resolve_settings(settings, usual)
        wanted = wanted or settings.sensor
    request = Request(
        address, wanted, imu, fps, requested_size(settings, split=split), split, topics
    )
    device = kind.open(request)
    if imu:
        _refuse_imu(device.name, "imu" not in device.streams)
    return LiveStream(device, wanted, settings=settings, fps=fps, split=split)


def _refuse_imu(name: str, is_wrong: bool) -> None:
    if is_wrong:
        raise DatasetError(f"{name} has no IMU; leave out --imu")
