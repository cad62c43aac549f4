# SPDX-License-Identifier: BSD-3-Clause
"""A map as COLMAP's cameras, images and points.

J. L. Schönberger, J.-M. Frahm, "Structure-from-motion revisited", CVPR 2016; "Output format" in
COLMAP's documentation, from which the conventions are:

* Images hold the pose world to camera; cameras look along +z, x is right, y is down, as here.
* Quaternions are w, x, y, z.
* The centre of the top-left pixel is (0.5, 0.5); here it is (0, 0), so pixels and principal points
  get half a pixel more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.maps.content_groups import Cameras
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.exports.images import View, fisheye_of, pixel_scale
from orbslam2py.maps.reprojection import project_points

#: Numbers of the camera models and of the parameters each has.
MODEL_IDS = {"PINHOLE": 1, "OPENCV": 4, "OPENCV_FISHEYE": 5, "FULL_OPENCV": 6, "FOV": 7}

#: Fisheye models that COLMAP has, by our names.
COLMAP_LENSES = ("kannala_brandt", "fov")

#: Of points without a colour.
_GREY = 128


@dataclass(frozen=True, eq=False)
class ColmapCamera:
    """A row of ``cameras``."""

    camera_id: int
    model: str
    width: int
    height: int
    parameters: FloatArray
    """fx, fy, cx, cy, then k1, k2, p1, p2 (OPENCV), then k3 to k6 (FULL_OPENCV)."""


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """An entry of ``images``."""

    image_id: int
    """Id of the keyframe, plus 1: COLMAP's begin at 1."""
    quaternion: FloatArray
    """(4,) w, x, y, z of world to camera."""
    translation: FloatArray
    """(3,) of the same."""
    camera_id: int
    name: str
    pixels: FloatArray
    """(n, 2) all keypoints, in the order of the keyframe."""
    point_ids: IntArray
    """(n,) -1 for a keypoint without a point."""


@dataclass(frozen=True, eq=False)
class ColmapPoints:
    """``points3D``: (p,) entries, and (o,) members of their tracks."""

    ids: IntArray
    """(p,) id of the map point, plus 1."""
    positions: FloatArray
    """(p, 3)"""
    colours: ByteArray
    """(p, 3) RGB."""
    errors: FloatArray
    """(p,) mean reprojection error [px of the images]."""
    offsets: IntArray
    """(p + 1,) offsets into the tracks."""
    track_images: IntArray
    """(o,) ids of images."""
    track_keypoints: IntArray
    """(o,) numbers of the keypoints in the images, from 0."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class ColmapModel:
    """Cameras, images and points of one model."""

    cameras: tuple[ColmapCamera, ...]
    images: tuple[ColmapImage, ...]
    points: ColmapPoints


def colmap_model(contents: MapContents, views: list[View]) -> ColmapModel:
    """Make the model of these views; points that none of them sees are left out."""
    keyframes = contents.keyframes
    seen, xy, error = _sightings(contents, views)
    point_of_keypoint = np.full(len(keyframes.keypoints), -1, np.int64)
    rows = contents.observed_keypoints
    point_of_keypoint[rows[seen]] = contents.observations.point[seen] + 1
    kinds: dict[tuple[int, int, int, bool], ColmapCamera] = {}
    images = []
    for view in views:
        camera = int(keyframes.camera[view.row])
        kind = (camera, view.width, view.height, view.undistorted)
        if kind not in kinds:
            scale = pixel_scale(contents, view)
            kinds[kind] = _camera(len(kinds) + 1, contents.cameras, camera, view, scale)
        part = keyframes.keypoints_of(view.row)
        images.append(
            ColmapImage(
                image_id=int(keyframes.ids[view.row]) + 1,
                quaternion=keyframes.rotations[view.row, [3, 0, 1, 2]],
                translation=keyframes.translations[view.row],
                camera_id=kinds[kind].camera_id,
                name=view.name,
                pixels=xy[part],
                point_ids=point_of_keypoint[part],
            )
        )
    points = _points(contents, seen, error)
    return ColmapModel(tuple(kinds.values()), tuple(images), points)


def _sightings(contents: MapContents, views: list[View]) -> tuple[IntArray, FloatArray, FloatArray]:
    """Observations (s,) in the views, pixels of all keypoints (n, 2), errors (s,) [px]."""
    keyframes, observations = contents.keyframes, contents.observations
    xy = keyframes.keypoints.astype(np.float64)
    scales, bent = np.ones((len(keyframes), 2)), np.zeros(len(keyframes), bool)
    shown = np.zeros(len(keyframes), bool)
    for view in views:
        shown[view.row], bent[view.row] = True, not view.undistorted
        scales[view.row] = pixel_scale(contents, view)
        if bent[view.row] and not contents.cameras.model[keyframes.camera[view.row]]:
            part = keyframes.keypoints_of(view.row)
            xy[part] = keyframes.raw_keypoints[part]
    row_of_keypoint = np.repeat(np.arange(len(keyframes)), np.diff(keyframes.offsets))
    xy = (xy + 0.5) * scales[row_of_keypoint]
    seer = np.searchsorted(keyframes.ids, observations.keyframe)
    seen = np.flatnonzero(shown[seer])
    seer = seer[seen]
    point = np.searchsorted(contents.points.ids, observations.point[seen])
    expected = project_points(contents, seer, point, bent[seer])
    expected = (expected + 0.5) * scales[seer]
    for view in views:
        if view.pinhole is not None:
            part, own = keyframes.keypoints_of(view.row), seer == view.row
            xy[part] = view.pinhole.pixels_of(xy[part] - 0.5) + 0.5
            expected[own] = view.pinhole.pixels_of(expected[own] - 0.5) + 0.5
    error = np.linalg.norm(expected - xy[contents.observed_keypoints[seen]], axis=1)
    inside = np.isfinite(error)
    return seen[inside], np.nan_to_num(xy), error[inside]


def _camera(
    camera_id: int, cameras: Cameras, row: int, view: View, scale: tuple[float, float]
) -> ColmapCamera:
    sx, sy = scale
    pinhole = [
        sx * cameras.fx[row],
        sy * cameras.fy[row],
        sx * (cameras.cx[row] + 0.5),
        sy * (cameras.cy[row] + 0.5),
    ]
    if view.pinhole is not None:
        fx, fy, cx, cy = view.pinhole.intrinsics
        pinhole = [fx, fy, cx + 0.5, cy + 0.5]
    lens = cameras.distortion[row].tolist()
    fisheye = None if view.pinhole is not None else cameras.camera_model(row)
    if fisheye is not None:
        model, own = fisheye_of(fisheye, "COLMAP's model", {"fov": "FOV"})
        parameters = [sx * own[0], sy * own[1], *pinhole[2:], *own[4:]]
    elif view.undistorted:
        model, parameters = "PINHOLE", pinhole
    elif any(lens[4:]):
        model, parameters = "FULL_OPENCV", [*pinhole, *lens]
    else:
        model, parameters = "OPENCV", [*pinhole, *lens[:4]]
    return ColmapCamera(camera_id, model, view.width, view.height, np.array(parameters))


def _points(contents: MapContents, seen: IntArray, error: FloatArray) -> ColmapPoints:
    observations, points = contents.observations, contents.points
    row = np.searchsorted(points.ids, observations.point[seen])
    length = np.bincount(row, minlength=len(points))
    total = np.bincount(row, error, len(points))
    kept = length > 0
    colours = contents.point_colours()
    if colours is None:
        colours = np.full((len(points), 3), _GREY, np.uint8)
    return ColmapPoints(
        ids=points.ids[kept] + 1,
        positions=points.positions[kept],
        colours=colours[kept],
        errors=total[kept] / length[kept],
        offsets=np.concatenate([[0], np.cumsum(length[kept])]).astype(np.int64),
        track_images=observations.keyframe[seen] + 1,
        track_keypoints=observations.keypoint[seen].astype(np.int64),
    )
