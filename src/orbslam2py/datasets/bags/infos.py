# SPDX-License-Identifier: BSD-3-Clause
"""The calibration of one camera of a bag."""

from __future__ import annotations

from orbslam2py.datasets.bags.bag import Bag, Topic
from orbslam2py.datasets.bags.calibration import CameraInfo
from orbslam2py.datasets.bags.image_topics import ImageTopic
from orbslam2py.datasets.bags.messages import CAMERA_INFO, read_message
from orbslam2py.datasets.bags.parts import naming_damage
from orbslam2py.datasets.bags.realsense import is_inverse
from orbslam2py.errors import DatasetError

#: Most messages of CameraInfo that are read to find one of a calibrated camera.
_MOST = 10
_ADVICE = (
    "give --settings with a file or a built-in name; 'orbslam2py settings new' makes a "
    "file of the numbers of the camera"
)


def read_info(bag: Bag, image: ImageTopic, topic: Topic | None, role: str) -> CameraInfo:
    """Return the first calibration of a camera.

    Parameters
    ----------
    bag, image
        The bag, and the images of the camera.
    topic
        Its CameraInfo; None if it has none.
    role
        Names that the user may give to the topic, for messages.

    Raises
    ------
    DatasetError
        If there is none, or it is for images of another size.
    """
    if topic is None:
        infos = [one.name for one in bag.topics if one.kind == CAMERA_INFO and one.n]
        named = f"take one of {', '.join(infos)} with --topics {role}=..., or " if infos else ""
        raise DatasetError(
            f"no settings for {bag.path}: it has no CameraInfo for {image.topic.name}; "
            f"{named}{_ADVICE}"
        )
    what = f"{topic.name} in {bag.path}"
    for message in bag.messages(topic)[:_MOST]:
        with naming_damage(bag.path):
            read = read_message(bag.read(message), topic.kind, topic.encoding)
        info = CameraInfo.of(read, what, inverse=is_inverse(bag, image))
        if info is not None:
            break
    else:
        raise DatasetError(
            f"no settings for {bag.path}: {topic.name} is of a camera that was not "
            f"calibrated; {_ADVICE}"
        )
    if image.size is not None and info.size != image.size:
        raise DatasetError(
            f"{what} is for {info.size[0]} x {info.size[1]} pixels, but images of "
            f"{image.topic.name} have {image.size[0]} x {image.size[1]}; {_ADVICE}"
        )
    return info


def info_if_any(bag: Bag, image: ImageTopic, topic: Topic | None) -> CameraInfo | None:
    """Return the first calibration of a camera; None if there is none that can be used."""
    try:
        return read_info(bag, image, topic, "info")
    except DatasetError:
        return None
