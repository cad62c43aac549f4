# SPDX-License-Identifier: BSD-3-Clause
"""The map outside of a running system: plain copies of it, and files of them."""

from orbslam2py.maps.contents import (
    Cameras,
    Covisibility,
    Keyframes,
    MapContents,
    Observations,
    Points,
    RemovedKeyframes,
)
from orbslam2py.maps.pcd import write_pcd
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.snapshot import MapSnapshot, keyframe_trajectory, take_snapshot

__all__ = [
    "Cameras",
    "Covisibility",
    "Keyframes",
    "MapContents",
    "MapSnapshot",
    "Observations",
    "Points",
    "RemovedKeyframes",
    "keyframe_trajectory",
    "take_snapshot",
    "write_pcd",
    "write_ply",
]
