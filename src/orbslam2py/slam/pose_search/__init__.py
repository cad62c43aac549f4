# SPDX-License-Identifier: BSD-3-Clause
"""Methods that estimate a frame's pose, and their order; ``docs/method/tracking.md``."""

from orbslam2py.slam.pose_search.first_estimate import (
    estimate_in_fixed_map,
    estimate_in_growing_map,
)
from orbslam2py.slam.pose_search.local_map_search import LocalMapSearch, RefinedPose
from orbslam2py.slam.pose_search.search import PoseSearch

__all__ = [
    "LocalMapSearch",
    "PoseSearch",
    "RefinedPose",
    "estimate_in_fixed_map",
    "estimate_in_growing_map",
]
