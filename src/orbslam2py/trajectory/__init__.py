# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories: poses with time stamps, their files, and their association."""

from orbslam2py.trajectory.association import MAX_DIFFERENCE, associate
from orbslam2py.trajectory.columns import QuaternionOrder
from orbslam2py.trajectory.files import (
    Reading,
    TrajectoryFile,
    read_euroc,
    read_kitti,
    read_trajectory,
    read_trajectory_file,
    read_tum,
)
from orbslam2py.trajectory.frame_times import FrameTable, read_frame_table, read_times
from orbslam2py.trajectory.layouts import TRAJECTORY_LAYOUTS, TrajectoryLayout
from orbslam2py.trajectory.similarity import Similarity, align, align_yaw
from orbslam2py.trajectory.time_units import TimeUnit, unit_by_other
from orbslam2py.trajectory.trajectory import Trajectory, lengths_along
from orbslam2py.trajectory.writers import TrajectoryFormat, write_euroc, write_kitti, write_tum

__all__ = [
    "MAX_DIFFERENCE",
    "TRAJECTORY_LAYOUTS",
    "FrameTable",
    "QuaternionOrder",
    "Reading",
    "Similarity",
    "TimeUnit",
    "Trajectory",
    "TrajectoryFile",
    "TrajectoryFormat",
    "TrajectoryLayout",
    "align",
    "align_yaw",
    "associate",
    "lengths_along",
    "read_euroc",
    "read_frame_table",
    "read_kitti",
    "read_times",
    "read_trajectory",
    "read_trajectory_file",
    "read_tum",
    "unit_by_other",
    "write_euroc",
    "write_kitti",
    "write_tum",
]
