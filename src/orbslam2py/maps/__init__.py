# SPDX-License-Identifier: BSD-3-Clause
"""The map outside of a running system: plain copies of it, and files of them."""

from orbslam2py.maps.changes import KeyframesSet, MapChanges, MapFollower, PointsSet
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.snapshot import MapSnapshot, keyframe_trajectory, take_snapshot

__all__ = [
    "KeyframesSet",
    "MapArrays",
    "MapChanges",
    "MapFollower",
    "MapSnapshot",
    "PointsSet",
    "keyframe_trajectory",
    "take_snapshot",
    "write_ply",
]
