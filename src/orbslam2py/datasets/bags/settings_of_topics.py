# SPDX-License-Identifier: BSD-3-Clause
"""Settings from the CameraInfo of chosen topics."""

from __future__ import annotations

from orbslam2py.datasets.bags.bag import Bag
from orbslam2py.datasets.bags.calibration import settings_of_camera, settings_of_pair
from orbslam2py.datasets.bags.infos import read_info
from orbslam2py.datasets.bags.pixels import units_per_metre
from orbslam2py.datasets.bags.realsense import units_per_metre_of
from orbslam2py.datasets.bags.topics import Chosen
from orbslam2py.datasets.bags.transforms import Transforms, names_of_coordinates
from orbslam2py.settings import Sensor, Settings


def settings_of_topics(
    bag: Bag, topics: Chosen, sensor: Sensor, frames: list[str], fps: float
) -> Settings:
    """Make settings of the CameraInfo that belong to images.

    Parameters
    ----------
    bag, topics
        The messages, and the topics of a run.
    sensor
        Sensor for which the images are used.
    frames
        Names of the cameras' coordinates in the heads of their messages, left first.
    fps
        Images per second.

    Raises
    ------
    DatasetError
        If there is no CameraInfo, or it cannot be used.
    """
    left = read_info(bag, topics.left, topics.left_info, "info")
    if topics.right is not None:
        right = read_info(bag, topics.right, topics.right_info, "right_info")
        rectified = topics.left.is_rectified and topics.right.is_rectified
        T = None
        if left.P[0, 3] == right.P[0, 3]:  # each was calibrated alone
            names = map(names_of_coordinates, (topics.left, topics.right), frames)
            T = Transforms(bag).between(*reversed(list(names)))
        return settings_of_pair(left, right, fps, rectified=rectified, T_right_left=T)
    depth = topics.depth
    units = None if depth is None else units_per_metre_of(bag, depth)
    return settings_of_camera(
        left,
        sensor,
        fps,
        rectified=topics.left.is_rectified,
        depth_factor=None if depth is None else units or units_per_metre(depth.encoding),
    )
