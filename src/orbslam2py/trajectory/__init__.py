# SPDX-License-Identifier: BSD-3-Clause
"""Paths over time: poses with time stamps, their files, and which belong together."""

from orbslam2py.trajectory.association import MAX_DIFFERENCE, associate
from orbslam2py.trajectory.files import (
    TrajectoryFormat,
    read_euroc,
    read_kitti,
    read_trajectory,
    read_tum,
    write_euroc,
    write_kitti,
    write_tum,
)
from orbslam2py.trajectory.frame_times import FrameTable, read_frame_table, read_times
from orbslam2py.trajectory.similarity import Similarity, align
from orbslam2py.trajectory.trajectory import Trajectory

__all__ = [
    "MAX_DIFFERENCE",
    "FrameTable",
    "Similarity",
    "Trajectory",
    "TrajectoryFormat",
    "align",
    "associate",
    "read_euroc",
    "read_frame_table",
    "read_kitti",
    "read_times",
    "read_trajectory",
    "read_tum",
    "write_euroc",
    "write_kitti",
    "write_tum",
]
