# SPDX-License-Identifier: BSD-3-Clause
"""Copies of maps outside a running system, and files of them."""

from orbslam2py.maps.changes import KeyframesSet, MapChanges, MapFollower, PointsSet
from orbslam2py.maps.compare import map_differences
from orbslam2py.maps.content_groups import (
    AlignedSightings,
    Cameras,
    Covisibility,
    ImuStates,
    Keyframes,
    Observations,
    Patches,
    Points,
    RemovedKeyframes,
)
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.edits.crop import crop_to_box, crop_to_times, keep_keyframes
from orbslam2py.maps.edits.placement import (
    Placement,
    place_by_length,
    place_by_points,
    place_by_trajectory,
)
from orbslam2py.maps.edits.saved import crop_saved_map
from orbslam2py.maps.edits.sighting_alignment import (
    AlignmentRecord,
    ImagePairSequence,
    align_sightings,
)
from orbslam2py.maps.edits.transform import transform_map
from orbslam2py.maps.exports.colmap import export_colmap
from orbslam2py.maps.exports.colours import with_colours
from orbslam2py.maps.exports.g2o import export_g2o
from orbslam2py.maps.exports.images import ImageOfKeyframe, ImageSequence, images_of
from orbslam2py.maps.exports.nerfstudio import export_nerfstudio
from orbslam2py.maps.exports.pcd import write_pcd
from orbslam2py.maps.exports.points import export_points
from orbslam2py.maps.exports.trajectories import export_trajectory, keyframe_path
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.maps.map_copies import restore_contents, take_contents
from orbslam2py.maps.map_file import MapFile, save_map
from orbslam2py.maps.map_reader import load_map
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.reprojection import reprojection_errors
from orbslam2py.maps.saved_map import RecordedFrames, Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.snapshot import (
    MapSnapshot,
    keyframe_trajectory,
    take_snapshot,
    take_snapshots,
)
from orbslam2py.maps.verify import verify_map_file

__all__ = [
    "AlignedSightings",
    "AlignmentRecord",
    "Cameras",
    "Covisibility",
    "ImageOfKeyframe",
    "ImagePairSequence",
    "ImageSequence",
    "ImuStates",
    "Keyframes",
    "KeyframesSet",
    "MapArrays",
    "MapChanges",
    "MapContents",
    "MapFile",
    "MapFollower",
    "MapSnapshot",
    "Observations",
    "Patches",
    "Placement",
    "Points",
    "PointsSet",
    "RecordedFrames",
    "RemovedKeyframes",
    "Run",
    "SavedMap",
    "VocabularyIdentity",
    "align_sightings",
    "crop_saved_map",
    "crop_to_box",
    "crop_to_times",
    "export_colmap",
    "export_g2o",
    "export_nerfstudio",
    "export_points",
    "export_trajectory",
    "images_of",
    "keep_keyframes",
    "keyframe_path",
    "keyframe_trajectory",
    "load_map",
    "map_differences",
    "place_by_length",
    "place_by_points",
    "place_by_trajectory",
    "reprojection_errors",
    "restore_contents",
    "save_map",
    "take_contents",
    "take_snapshot",
    "take_snapshots",
    "transform_map",
    "verify_map_file",
    "with_colours",
    "write_pcd",
    "write_ply",
]
