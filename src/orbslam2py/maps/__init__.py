# SPDX-License-Identifier: BSD-3-Clause
"""The map outside of a running system: plain copies of it, and files of them."""

from orbslam2py.maps.changes import KeyframesSet, MapChanges, MapFollower, PointsSet
from orbslam2py.maps.contents import (
    Cameras,
    Covisibility,
    Keyframes,
    MapContents,
    Observations,
    Points,
    RemovedKeyframes,
    restore_contents,
    take_contents,
)
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.maps.map_file import save_map
from orbslam2py.maps.map_reader import load_map
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.saved_map import RecordedFrames, Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.snapshot import MapSnapshot, keyframe_trajectory, take_snapshot

__all__ = [
    "Cameras",
    "Covisibility",
    "Keyframes",
    "KeyframesSet",
    "MapArrays",
    "MapChanges",
    "MapContents",
    "MapFollower",
    "MapSnapshot",
    "Observations",
    "Points",
    "PointsSet",
    "RecordedFrames",
    "RemovedKeyframes",
    "Run",
    "SavedMap",
    "VocabularyIdentity",
    "keyframe_trajectory",
    "load_map",
    "restore_contents",
    "save_map",
    "take_contents",
    "take_snapshot",
    "write_ply",
]
