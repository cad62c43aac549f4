# SPDX-License-Identifier: BSD-3-Clause
"""Messages of cameras and IMUs, with what a test wants in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py.ros.messages import Heading, Transform, transforms
from orbslam2py.ros.types import message_class

#: Stamp of the first message [ns], with all digits, and the step between two.
START, STEP = 1_700_000_000_123_456_789, 50_000_000


def raw_image(
    array: npt.NDArray[Any], encoding: str, stamp: int = START, frame: str = "camera"
) -> Any:
    data = np.ascontiguousarray(array).view(np.uint8).reshape(-1)
    height, width = array.shape[:2]
    fields = (height, width, encoding, 0, data.size // height, data)
    return message_class("sensor_msgs/msg/Image")(Heading(stamp, frame).message(), *fields)


def packed_image(content: bytes, form: str, stamp: int = START) -> Any:
    data = np.frombuffer(content, np.uint8)
    kind = message_class("sensor_msgs/msg/CompressedImage")
    return kind(Heading(stamp, "camera").message(), form, data)


def camera_info(
    size: tuple[int, int], stamp: int = START, *, f: float = 100.0, bf: float = 0.0
) -> Any:
    width, height = size
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1.0]])
    P = np.hstack([K, [[-bf], [0.0], [0.0]]])
    region = message_class("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False)
    matrices = (np.zeros(5), K.ravel(), np.eye(3).ravel(), P.ravel())
    head = Heading(stamp, "camera").message()
    kind = message_class("sensor_msgs/msg/CameraInfo")
    return kind(head, height, width, "plumb_bob", *matrices, 0, 0, region)


def imu(stamp: int, gyro: tuple[float, ...], accel: tuple[float, ...]) -> Any:
    vector = message_class("geometry_msgs/msg/Vector3")
    turned = message_class("geometry_msgs/msg/Quaternion")(0.0, 0.0, 0.0, 1.0)
    zeros = np.zeros(9)
    head = Heading(stamp, "imu").message()
    kind = message_class("sensor_msgs/msg/Imu")
    return kind(head, turned, zeros, vector(*gyro), zeros, vector(*accel), zeros)


def static_transform(parent: str, child: str, T_parent_child: npt.ArrayLike) -> Any:
    T = np.asarray(T_parent_child, np.float64)
    return transforms([Transform(Heading(START, parent), child, T)])
