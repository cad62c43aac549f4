# SPDX-License-Identifier: BSD-3-Clause
"""Ground truth that was recorded in a bag."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.bag import Bag, Topic
from orbslam2py.datasets.bags.messages import read_message, stamp_of
from orbslam2py.datasets.bags.parts import naming_damage
from orbslam2py.datasets.bags.timing import stamps_of
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import poses_from, rotations_from_quaternions


def read_poses(bag: Bag, topic: Topic) -> Trajectory:
    """Read poses of the camera in its world.

    Parameters
    ----------
    bag, topic
        Messages of the type PoseStamped, TransformStamped or Odometry.

    Returns
    -------
    Trajectory
        Camera to world, in the order of the stamps.

    Raises
    ------
    DatasetError
        If there are no valid poses.
    """
    found: dict[int, list[float]] = {}
    for message in bag.messages(topic):
        with naming_damage(bag.path):
            read = read_message(bag.read(message), topic.kind, topic.encoding)
        numbers = _numbers(read)
        if np.isfinite(numbers).all() and any(numbers[3:]):
            found.setdefault(stamp_of(read.header), numbers)
    if not found:
        raise DatasetError(
            f"{bag.path}: {topic} has no pose that makes sense; leave 'truth' out of --topics"
        )
    stamps = sorted(found)
    table = np.array([found[stamp] for stamp in stamps])
    poses = poses_from(rotations_from_quaternions(table[:, 3:]), table[:, :3])
    return Trajectory(stamps_of(stamps).seconds, poses)


def pose_of_numbers(*numbers: float) -> FloatArray:
    """Make a transform (4, 4) of x, y, z and a quaternion x, y, z, w; NaN if they are invalid."""
    if not np.isfinite(numbers).all() or not any(numbers[3:]):
        return np.full((4, 4), np.nan)
    table = np.array([numbers])
    T: FloatArray = poses_from(rotations_from_quaternions(table[:, 3:]), table[:, :3])[0]
    return T


def _numbers(message: Any) -> list[float]:
    """Return x, y, z and the quaternion x, y, z, w of a message."""
    if hasattr(message, "transform"):
        at, turned = message.transform.translation, message.transform.rotation
    else:
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        at, turned = pose.position, pose.orientation
    return [at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w]
