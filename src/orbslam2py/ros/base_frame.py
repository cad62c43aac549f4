# SPDX-License-Identifier: BSD-3-Clause
"""Where the camera is on the robot: given by the user, by the robot's TF, or assumed."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.ros.device import TopicsDevice
from orbslam2py.settings import Settings
from orbslam2py.trajectory.robot_frames import RobotBase, pose_of_forward_camera
from orbslam2py.trajectory.rotations import inverse_poses, poses_from, rotations_from_quaternions

_log = logging.getLogger(__name__)

BASE = "base_link"
#: Default name of the camera's coordinate frame.
_OPTICAL = "camera_optical_frame"
_POSITION, _POSE = 3, 7


@dataclass(frozen=True, eq=False)
class BaseFrame:
    """The robot's frame.

    Attributes
    ----------
    name
        Such as ``base_link``.
    camera
        Name of the camera's (optical) frame.
    robot
        Where the rectified camera is on the robot.
    child, T_base_child
        The static transform (4, 4) [m] to be published: to the camera's frame, or to the root of
        the tree that its driver publishes; None if the robot publishes it itself.
    publishes_tf
        Whether transforms are to be published: not if the base has a parent already.
    """

    name: str
    camera: str
    robot: RobotBase
    child: str
    T_base_child: FloatArray | None
    publishes_tf: bool = True


def base_of_camera() -> BaseFrame:
    """Return a base at the camera, which looks forward, for viewers."""
    T = pose_of_forward_camera()
    return BaseFrame(BASE, _OPTICAL, RobotBase(T), _OPTICAL, T)


def for_viewers(base: BaseFrame) -> BaseFrame:
    """Return the same with all its transforms, for receivers without those of the robot."""
    T = base.robot.T_base_camera
    return replace(base, child=base.camera, T_base_child=T, publishes_tf=True)


def choose_base(
    settings: Settings, device: TopicsDevice | None, name: str | None, transform: str | None
) -> BaseFrame:
    """Find where the camera is on the robot.

    Parameters
    ----------
    settings
        Of the run: raw images of a pair are turned when they are rectified.
    device
        The topics that the images come from; None if they come from elsewhere.
    name, transform
        Frame of the base and the place of the camera in it, as the user gave them.

    Raises
    ------
    DatasetError
        If a frame was named, and the pose of the camera in it is unknown.
    """
    base = (name or BASE).strip("/")
    camera = (device.frame if device is not None else "") or _OPTICAL
    told, to_publish = None, True
    if transform is not None:
        told = read_transform(transform)
    elif device is not None and (found := device.between(base, camera)) is not None:
        told, to_publish = found, False
    if told is None and name is not None:
        raise DatasetError(
            f"--base-frame {name}: no static transform (/tf_static) leads from it to the camera's "
            f"frame '{camera}'; start the node that publishes it (robot_state_publisher), or give "
            "it: --base-transform X,Y,Z,QX,QY,QZ,QW"
        )
    if told is None:
        told = pose_of_forward_camera()
        _log.warning(
            "the pose of the camera on the robot is unknown: %s is assumed to be at the camera, "
            "which looks forward; give --base-transform, or publish /tf_static",
            base,
        )
    parent = None if device is None else device.parent_of(base)
    if parent is not None:
        _log.warning(
            "/tf has %s as a child of %s already, and a frame has one parent: no transforms are "
            "published; to have them, give the first frame of the robot's tree as --base-frame",
            *(base, parent),
        )
    robot = RobotBase(told @ _raw_from_rectified(settings))
    child, T_child_camera = (camera, np.eye(4)) if device is None else device.root_of(camera)
    T_base_child = told @ inverse_poses(T_child_camera) if to_publish else None
    return BaseFrame(base, camera, robot, child, T_base_child, parent is None)


def read_transform(text: str) -> FloatArray:
    """Read where the camera's optical frame is in the base's: numbers, or a file of such.

    Three numbers are the position [m] of a camera that looks forward; seven are position and
    quaternion x, y, z, w of the optical frame; sixteen are a matrix ``T_base_camera``, row by row.

    Raises
    ------
    DatasetError
        If they are none of these.
    """
    path = Path(text)
    try:
        content = path.read_text(encoding="utf-8") if path.is_file() else text
        numbers = np.array([float(number) for number in content.replace(",", " ").split()])
    except (ValueError, OSError):
        numbers = np.zeros(0)
    T = _pose_of(numbers) if np.isfinite(numbers).all() else None
    if T is None:
        raise DatasetError(
            f"--base-transform {text} is no place of the camera; give X,Y,Z in metres for a camera "
            "that looks forward, or X,Y,Z,QX,QY,QZ,QW of its optical frame, or a file with these "
            "numbers or with the 16 of a matrix"
        )
    return T


def _pose_of(numbers: FloatArray) -> FloatArray | None:
    if len(numbers) == _POSITION:
        T = pose_of_forward_camera()
        T[:3, 3] = numbers
        return T
    if len(numbers) == _POSE and numbers[3:].any():
        R = rotations_from_quaternions(numbers[None, 3:])
        return np.asarray(poses_from(R, numbers[None, :3])[0])
    if len(numbers) == 16:
        T = numbers.reshape(4, 4)
        R = T[:3, :3]
        is_rigid = np.abs(R @ R.T - np.eye(3)).max() < 1e-3 and np.linalg.det(R) > 0
        return T if is_rigid and np.array_equal(T[3], [0, 0, 0, 1]) else None
    return None


def _raw_from_rectified(settings: Settings) -> FloatArray:
    """Return the transform (4, 4) from rectified to raw coordinates of the left camera."""
    T = np.eye(4)
    if settings.rectification is not None:
        T[:3, :3] = settings.rectification.left.R
    return np.asarray(inverse_poses(T), np.float64)
