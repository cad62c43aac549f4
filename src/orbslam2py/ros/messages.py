# SPDX-License-Identifier: BSD-3-Clause
"""Messages of ROS 2 from poses, points and covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.ros.types import message_class
from orbslam2py.trajectory.rotations import quaternions_from_rotations

POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
PATH = "nav_msgs/msg/Path"
POINTS = "sensor_msgs/msg/PointCloud2"
STRING = "std_msgs/msg/String"
TF = "tf2_msgs/msg/TFMessage"
IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
MARKER = "visualization_msgs/msg/ImageMarker"
_NANO = 10**9
#: `ImageMarker.POINTS`, and the size of a point in pixels.
_POINTS_OF_IMAGE, _POINT_SIZE = 4, 3.0
#: `PointField.FLOAT32`, and its bytes.
_FLOAT32, _FLOAT_SIZE = 7, 4


@dataclass(frozen=True)
class Heading:
    """The header of a message.

    Attributes
    ----------
    stamp
        Nanoseconds.
    frame
        Name of the coordinates.
    """

    stamp: int
    frame: str

    def message(self) -> Any:
        """Make the ``Header``."""
        time = message_class("builtin_interfaces/msg/Time")(*divmod(self.stamp, _NANO))
        return message_class("std_msgs/msg/Header")(time, self.frame)


@dataclass(frozen=True, eq=False)
class Transform:
    """A transform of TF.

    Attributes
    ----------
    head
        Time, and the parent frame.
    child
        Name of the child frame.
    T_parent_child
        (4, 4) [m].
    """

    head: Heading
    child: str
    T_parent_child: FloatArray


def pose_stamped(head: Heading, T: FloatArray) -> Any:
    """Make a ``PoseStamped`` of (4, 4)."""
    return message_class(POSE)(head.message(), _pose(T))


def pose_with_covariance(head: Heading, T: FloatArray, covariance: FloatArray) -> Any:
    """Make a ``PoseWithCovarianceStamped``; (6, 6) of x, y, z, then rotations, axes of the head."""
    return message_class(POSE_WITH_COVARIANCE)(head.message(), _with_covariance(T, covariance))


def odometry(
    head: Heading,
    child: str,
    T: FloatArray,
    covariance: FloatArray,
    twist: FloatArray,
    twist_covariance: FloatArray,
) -> Any:
    """Make an ``Odometry``.

    Parameters
    ----------
    head, child
        Frame of the pose, and frame of the body.
    T, covariance
        Pose (4, 4) and its covariance (6, 6) in the axes of the head's frame.
    twist, twist_covariance
        Linear, then angular velocity (6,) and their covariance (6, 6) in the child's frame.
    """
    vector = message_class("geometry_msgs/msg/Vector3")
    velocity = message_class("geometry_msgs/msg/Twist")(
        vector(*twist[:3].tolist()), vector(*twist[3:].tolist())
    )
    with_covariance = message_class("geometry_msgs/msg/TwistWithCovariance")(
        velocity, np.ascontiguousarray(twist_covariance, np.float64).reshape(-1)
    )
    pose = _with_covariance(T, covariance)
    return message_class(ODOMETRY)(head.message(), child, pose, with_covariance)


def path(head: Heading, stamps: Sequence[int], T: FloatArray) -> Any:
    """Make a ``Path`` of stamps [ns] and poses (n, 4, 4)."""
    poses = [
        message_class(POSE)(Heading(stamp, head.frame).message(), _pose(one))
        for stamp, one in zip(stamps, T, strict=True)
    ]
    return message_class(PATH)(head.message(), poses)


def points(head: Heading, positions: FloatArray) -> Any:
    """Make a ``PointCloud2`` of positions (n, 3): fields x, y, z, float32."""
    field = message_class("sensor_msgs/msg/PointField")
    fields = [field(name, _FLOAT_SIZE * i, _FLOAT32, 1) for i, name in enumerate("xyz")]
    data = np.ascontiguousarray(positions, "<f4").view(np.uint8).reshape(-1)
    step, n = 3 * _FLOAT_SIZE, len(positions)
    return message_class(POINTS)(head.message(), 1, n, fields, False, step, step * n, data, True)


def jpeg(head: Heading, content: bytes) -> Any:
    """Make a ``CompressedImage`` of a JPEG."""
    return message_class(IMAGE)(head.message(), "jpeg", np.frombuffer(content, np.uint8))


def image_points(head: Heading, pixels: FloatArray, colours: FloatArray) -> Any:
    """Make an ``ImageMarker`` of pixels (n, 2) and their colours (n, 3), 0 to 1."""
    point, colour = (
        message_class("geometry_msgs/msg/Point"),
        message_class("std_msgs/msg/ColorRGBA"),
    )
    black = colour(0.0, 0.0, 0.0, 0.0)
    lifetime = message_class("builtin_interfaces/msg/Duration")(0, 0)
    places = [point(x, y, 0.0) for x, y in pixels.tolist()]
    painted = [colour(*one, 1.0) for one in colours.tolist()]
    fields = (0, _POINTS_OF_IMAGE, 0, point(0.0, 0.0, 0.0), _POINT_SIZE, black, 0, black, lifetime)
    return message_class(MARKER)(head.message(), "keypoints", *fields, places, painted)


def camera_info(head: Heading, size: tuple[int, int], K: FloatArray, D: FloatArray) -> Any:
    """Make a ``CameraInfo``: width and height, camera matrix (3, 3), distortion k1 k2 p1 p2 k3."""
    region = message_class("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False)
    P = np.hstack([K, np.zeros((3, 1))])
    matrices = (np.asarray(D, np.float64), K.reshape(-1), np.eye(3).reshape(-1), P.reshape(-1))
    width, height = size
    kind = message_class(CAMERA_INFO)
    return kind(head.message(), height, width, "plumb_bob", *matrices, 0, 0, region)


def string(text: str) -> Any:
    """Make a ``String``."""
    return message_class(STRING)(text)


def transforms(given: Sequence[Transform]) -> Any:
    """Make a ``TFMessage``."""
    vector = message_class("geometry_msgs/msg/Vector3")
    made = []
    for one in given:
        at = vector(*one.T_parent_child[:3, 3].tolist())
        transform = message_class("geometry_msgs/msg/Transform")(at, _turned(one.T_parent_child))
        kind = message_class("geometry_msgs/msg/TransformStamped")
        made.append(kind(one.head.message(), one.child, transform))
    return message_class(TF)(made)


def _pose(T: FloatArray) -> Any:
    at = message_class("geometry_msgs/msg/Point")(*T[:3, 3].tolist())
    return message_class("geometry_msgs/msg/Pose")(at, _turned(T))


def _turned(T: FloatArray) -> Any:
    q = quaternions_from_rotations(T[None, :3, :3])[0].tolist()
    return message_class("geometry_msgs/msg/Quaternion")(*q)


def _with_covariance(T: FloatArray, covariance: FloatArray) -> Any:
    numbers = np.ascontiguousarray(covariance, np.float64).reshape(-1)
    return message_class("geometry_msgs/msg/PoseWithCovariance")(_pose(T), numbers)
