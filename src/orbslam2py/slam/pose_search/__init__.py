# SPDX-License-Identifier: BSD-3-Clause
"""The ways to a frame's pose, and in which order they are tried; ``docs/method/tracking.md``."""

from orbslam2py.slam.pose_search.first_estimate import (
    FirstEstimate,
    FirstEstimateInFixedMap,
    FirstEstimateInGrowingMap,
)
from orbslam2py.slam.pose_search.local_map_search import LocalMapSearch
from orbslam2py.slam.pose_search.refined_pose import RefinedPose
from orbslam2py.slam.pose_search.search import PoseSearch

__all__ = [
    "FirstEstimate",
    "FirstEstimateInFixedMap",
    "FirstEstimateInGrowingMap",
    "LocalMapSearch",
    "PoseSearch",
    "RefinedPose",
]
