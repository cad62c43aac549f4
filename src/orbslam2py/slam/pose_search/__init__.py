# SPDX-License-Identifier: BSD-3-Clause
"""The ways to a frame's pose, and in which order they are tried; ``docs/method/tracking.md``."""

from orbslam2py.slam.pose_search.first_estimate import (
    FirstEstimate,
    FirstEstimateInFixedMap,
    FirstEstimateInGrowingMap,
)
from orbslam2py.slam.pose_search.motion_model import MotionModel
from orbslam2py.slam.pose_search.search import PoseSearch, RefinedPose

__all__ = [
    "FirstEstimate",
    "FirstEstimateInFixedMap",
    "FirstEstimateInGrowingMap",
    "MotionModel",
    "PoseSearch",
    "RefinedPose",
]
