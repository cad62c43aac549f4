# SPDX-License-Identifier: BSD-3-Clause
"""Messages of ROS as Python objects: headers of images at once, the rest by rosbags."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from orbslam2py.datasets.bags.libraries import require, type_store
from orbslam2py.errors import DatasetError

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
IMU = "sensor_msgs/msg/Imu"
#: Types of messages that may hold true poses.
POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TransformStamped",
    "nav_msgs/msg/Odometry",
)
#: Types of messages with transforms between frames, by their names in ROS 2 and in old ROS 1.
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
#: Encodings of messages that can be read.
ENCODINGS = ("ros1", "cdr")
#: The head of every image is within this number of bytes.
HEAD_SIZE = 512

_NANO = 10**9


@dataclass(frozen=True)
class Head:
    """The contents of the first bytes of an image message.

    Attributes
    ----------
    stamp
        Time of the image, nanoseconds; 0 if the driver gave none.
    frame
        Frame id of the camera.
    size
        Width and height in pixels; None if the image is compressed.
    """

    stamp: int
    frame: str
    size: tuple[int, int] | None


def read_head(content: bytes, kind: str, encoding: str) -> Head:
    """Read the header of an image message.

    Parameters
    ----------
    content
        The message or its first `HEAD_SIZE` bytes.
    kind, encoding
        Its type, and how it is serialised.

    Raises
    ------
    DatasetError
        If it is too short; the message does not name the bag.
    """
    # ROS 1: sequence number, seconds, nanoseconds, text. CDR: four bytes with the byte order, the
    # same without the number; the text ends with 0, and numbers are aligned to their size.
    ros1 = encoding == "ros1"
    order = "<" if ros1 or content[1:2] == b"\x01" else ">"
    try:
        seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", content, 4)
        begin = 16
        frame = content[begin : begin + length].rstrip(b"\0").decode("utf-8", "replace")
        size = None
        if kind == IMAGE:
            position = begin + length
            if not ros1:
                position += -(position - 4) % 4
            height, width = struct.unpack_from(f"{order}II", content, position)
            size = (int(width), int(height))
    except struct.error as error:
        raise DatasetError(f"a message is too short ({len(content)} bytes)") from error
    return Head(seconds * _NANO + nanoseconds, frame, size)


def read_message(content: bytes, kind: str, encoding: str, store: Any = None) -> Any:
    """Read a message of a common type.

    Parameters
    ----------
    content, kind, encoding
        The message, its type, and how it is serialised.
    store
        Typestore of rosbags that has the type; by default that of the common types.

    Returns
    -------
    object
        With the fields of the type in ROS 2 (those of CameraInfo in upper case for ROS 1).

    Raises
    ------
    DatasetError
        If it is damaged; the message does not name the bag.
    """
    serde = require("rosbags.serde")
    kind = TRANSFORMS[0] if kind in TRANSFORMS else kind
    store = type_store(encoding) if store is None else store
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    try:
        return read(content, kind)
    except (
        *(serde.SerdeError, struct.error, ValueError, IndexError),
        *(AssertionError, OverflowError, MemoryError),
    ) as error:
        raise DatasetError(f"a message of type {kind} is damaged") from error


def stamp_of(header: Any) -> int:
    """Return the stamp of a header in nanoseconds."""
    return int(header.stamp.sec) * _NANO + int(header.stamp.nanosec)
