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
from orbslam2py.maps.crop import crop_to_box, crop_to_times, keep_keyframes
from orbslam2py.maps.exports.colmap import export_colmap
from orbslam2py.maps.exports.colours import with_colours
from orbslam2py.maps.exports.g2o import export_g2o
from orbslam2py.maps.exports.images import ImageOfKeyframe, ImageSequence, images_of
from orbslam2py.maps.exports.nerfstudio import export_nerfstudio
from orbslam2py.maps.exports.points import export_points
from orbslam2py.maps.exports.trajectories import export_trajectory, keyframe_path
from orbslam2py.maps.pcd import write_pcd
from orbslam2py.maps.placement import (
    Placement,
    place_by_length,
    place_by_points,
    place_by_trajectory,
)
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.snapshot import MapSnapshot, keyframe_trajectory, take_snapshot
from orbslam2py.maps.transform import transform_map

__all__ = [
    "Cameras",
    "Covisibility",
    "ImageOfKeyframe",
    "ImageSequence",
    "Keyframes",
    "MapContents",
    "MapSnapshot",
    "Observations",
    "Placement",
    "Points",
    "RemovedKeyframes",
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
    "place_by_length",
    "place_by_points",
    "place_by_trajectory",
    "take_snapshot",
    "transform_map",
    "with_colours",
    "write_pcd",
    "write_ply",
]
