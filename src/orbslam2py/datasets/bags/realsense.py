# SPDX-License-Identifier: BSD-3-Clause
"""The data that the RealSense Viewer and SDK write beside the images of a stream.

Up to SDK 2.58 the file is a bag of ROS 1, from 2.59 on an SQLite file of ROS 2 without
metadata.yaml. The topics of a stream have a common prefix, ``/device_0/sensor_1/Color_0``: images
in ``/image/data`` (or ``/image/data/compressed``), the calibration, and in ``/tf`` the transform to
a reference of the device. Messages of SQLite files have times of arrival; the times of the camera
are in texts of ``/image/metadata``.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.bag import Bag, Message, Topic
from orbslam2py.datasets.bags.image_topics import ImageTopic
from orbslam2py.datasets.bags.messages import ENCODINGS, read_message
from orbslam2py.datasets.bags.poses import pose_of_numbers
from orbslam2py.datasets.bags.timing import TimedMessages
from orbslam2py.errors import DatasetError

_log = logging.getLogger(__name__)

_STREAM = re.compile(r"((/device_\d+)/sensor_\d+)/[^/]+(?=/)")
_EXTRINSICS = re.compile(r"(/device_\d+/sensor_\d+/[^/]+)/tf/(?:ref_)?(\d+)")
_STRING, _TRANSFORM = "std_msgs/msg/String", "geometry_msgs/msg/Transform"
_NUMBERS = ("std_msgs/msg/Float32", "std_msgs/msg/Float64", _STRING)
_NANO_PER_MILLI = 10**6


def stream_of(image: ImageTopic) -> str | None:
    """Return the name of the stream that images belong to; None if the SDK did not write them."""
    match = _STREAM.match(image.topic.name)
    return None if match is None else match[0]


def read_extrinsics(bag: Bag) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield the poses of the streams of a bag.

    Yields
    ------
    stream, reference, T_stream_reference
        Names, and the transform (4, 4) [m] from the coordinates of the reference to those of the
        stream; NaN if it cannot be read.
    """
    for topic in bag.topics:
        match = _EXTRINSICS.fullmatch(topic.name)
        if match is None or topic.kind not in (_STRING, _TRANSFORM):
            continue
        reference = f"{match[1].split('/sensor_')[0]}/ref_{match[2]}"
        for message in _messages(bag, topic)[:1]:
            yield match[1], reference, _extrinsics_of(message)


def camera_times(
    bag: Bag, images: list[ImageTopic], timed: list[TimedMessages]
) -> list[TimedMessages]:
    """Replace times of arrival by times of the camera, if the SDK wrote those.

    Parameters
    ----------
    bag
        The bag.
    images, timed
        Streams, with their messages by their stamps.

    Returns
    -------
    list of TimedMessages
        Unchanged, if the bag does not have other times by one clock for all streams.
    """
    of_sdk = [one for one in images if stream_of(one) and one.topic.encoding == "cdr"]
    if len(of_sdk) < len(images):
        return timed
    stamps = [_camera_stamps(bag, one.base) for one in images]
    retimed = [
        _retimed(messages, {at: stamp for at, (_, stamp) in found.items()})
        for messages, found in zip(timed, stamps, strict=True)
    ]
    # A few images may have lost their times; if most have none of their own, these are no times.
    both = list(zip(images, timed, retimed, strict=True))
    without = next((o for o, old, new in both if 2 * len(new.messages) < len(old.messages)), None)
    clocks = {clock for found in stamps for clock, _ in found.values()}
    if without is not None or len(clocks) > 1:
        reason = (
            f"{without.topic.name} has no times of the camera beside it (.../image/metadata)"
            if without
            else f"the streams have different clocks ({', '.join(sorted(clocks))})"
        )
        _log.warning(
            "%s: %s; the times of arrival are taken, by which images of one moment may be some "
            "milliseconds apart",
            *(bag.path, reason),
        )
        return timed
    for one, old, new in both:
        missing = len(old.messages) - len(new.messages)
        if missing:
            _log.warning(
                "%s: %s of %s without a time stamp of the camera, left out",
                *(bag.path, number_of(missing, "image"), one.topic.name),
            )
    return retimed


def units_per_metre_of(bag: Bag, depth: ImageTopic) -> float | None:
    """Return the units of depth per metre in the file; None if the SDK did not write them."""
    match = _STREAM.match(depth.topic.name)
    if match is None:
        return None
    names = [f"{match[1]}/option/Depth{gap}Units/value" for gap in "_ "]
    for topic in bag.topics:
        if topic.name in names and topic.kind in _NUMBERS:
            for message in _messages(bag, topic)[:1]:
                try:
                    metres = float(message.data)
                except ValueError:
                    continue
                if 0 < metres < np.inf:
                    return round(1 / metres, 3)
    return None


def is_inverse(bag: Bag, image: ImageTopic) -> bool:
    """Return whether a calibration has the inverse distortion of the SDK."""
    stream = stream_of(image)
    topics = (one for one in bag.topics if one.name == f"{stream}/camera_info")
    told = (m for one in topics if one.kind == _STRING for m in _messages(bag, one)[:1])
    return any("model=inverse" in str(message.data).lower() for message in told)


def stamps_of_imu(bag: Bag, topic: Topic) -> dict[int, int]:
    """Times of the camera [ns] of samples by the times at which they were recorded.

    Empty if the topic is not of an SQLite file of the SDK, whose messages carry times of arrival.
    """
    if _STREAM.match(topic.name) is None or topic.encoding != "cdr":
        return {}
    return {at: stamp for at, (_, stamp) in _camera_stamps(bag, topic.name).items()}


def _camera_stamps(bag: Bag, data: str) -> dict[int, tuple[str, int]]:
    """Clock and stamp [ns] of the messages of a topic by the times at which they arrived."""
    name = data.rpartition("/")[0] + "/metadata"
    stamps = {}
    for topic in bag.topics:
        if topic.name != name or topic.kind != _STRING:
            continue
        for message in bag.messages(topic):
            try:
                read = read_message(bag.read(message), topic.kind, topic.encoding)
            except DatasetError:
                continue
            fields = dict(part.partition("=")[::2] for part in str(read.data).split(";"))
            match = re.fullmatch(r"(\d+)(?:\.(\d*))?", fields.get("timestamp", "").strip())
            if match is not None:
                rest = int((match[2] or "").ljust(6, "0")[:6])
                stamp = int(match[1]) * _NANO_PER_MILLI + rest
                stamps[message.recorded] = (fields.get("timestamp_domain", ""), stamp)
    return stamps


def _retimed(timed: TimedMessages, stamps: dict[int, int]) -> TimedMessages:
    """Give messages new stamps, by their times of recording; leave out those without one."""
    found: dict[int, Message] = {}
    for message in timed.messages:
        if message.recorded in stamps:
            found.setdefault(stamps[message.recorded], message)
    ordered = sorted(found)
    return replace(timed, nanoseconds=ordered, messages=[found[stamp] for stamp in ordered])


def _messages(bag: Bag, topic: Topic) -> list[Any]:
    """Yield the readable messages of a topic with few messages."""
    if topic.encoding not in ENCODINGS:
        return []
    found = []
    for message in bag.messages(topic):
        try:
            found.append(read_message(bag.read(message), topic.kind, topic.encoding))
        except DatasetError:
            _log.warning("%s: a message of %s is damaged, left out", bag.path, topic.name)
    return found


def _extrinsics_of(message: Any) -> FloatArray:
    """Read ``T_stream_reference`` (4, 4) of a message; NaN if it has none."""
    if hasattr(message, "translation"):
        at, turned = message.translation, message.rotation
        return pose_of_numbers(at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w)
    T = np.full((4, 4), np.nan)
    fields = dict(part.partition("=")[::2] for part in str(message.data).split(";"))
    try:
        R, t = (
            np.array([float(number) for number in fields[name].split(",")])
            for name in ("rotation", "translation")
        )
        # The SDK writes rotations column by column.
        T[:3, :3], T[:3, 3], T[3] = R.reshape(3, 3).T, t.reshape(3), (0, 0, 0, 1)
    except (KeyError, ValueError):
        return np.full((4, 4), np.nan)
    return T
