# SPDX-License-Identifier: BSD-3-Clause
"""Maps as data for nerfstudio, for radiance fields and Gaussian splatting."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.errors import DatasetError, MapFileError
from orbslam2py.maps.content_groups import Cameras
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.folder import export_folder, refuse_rig, write_images
from orbslam2py.maps.exports.images import (
    ImageOfKeyframe,
    Progress,
    View,
    fisheye_of,
    pixel_scale,
    views_without_images,
)
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.units import unit_of

#: From the world (y down) of a map without an IMU to one whose z points up; the same transform that
#: nerfstudio applies to models of COLMAP.
_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0, 0, 0, 1]])

#: From OpenGL's camera (y up, looking along -z) to OpenCV's (y down, looking along +z).
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])

_POINTS = "sparse_pc.ply"


def export_nerfstudio(
    contents: MapContents,
    folder: str | Path,
    *,
    images: ImageOfKeyframe | None = None,
    image_names: Mapping[int, str | Path] | None = None,
    replace: bool = False,
    progress: Progress | None = None,
    field: float | None = None,
) -> None:
    """Write a map as ``transforms.json`` with its points in ``sparse_pc.ply``, and ``images``.

    ``transform_matrix`` maps the camera in OpenGL's axes (x right, y up, looking along -z) to a
    world with z up; ``applied_transform`` is the transform from the map's world to it. The centre
    of the top-left pixel is (0.5, 0.5), half a pixel more than in this package (M. Tancik et al.,
    "Nerfstudio", SIGGRAPH 2023; "Data conventions" in its documentation).

    Parameters
    ----------
    contents
        The map; the unit of length does not change (one camera: the map's own).
    folder
        The folder: new, empty, or with `replace` an earlier export.
    images
        The source of the keyframes' images (`images_of`). They are written without distortion;
        keyframes without an image are left out. Without `images` no images are written, and the
        cameras have their distortion.
    image_names
        Paths of existing images, absolute or relative to the folder, by keyframe id, if `images` is
        not given; keyframes without a path are left out.
    replace
        Replace an earlier export.
    progress
        ``progress(done, total)`` after every image.
    field
        Fisheye cameras: write `images` as a pinhole sees them, with this angle of view in the
        longer direction [degrees]. By default, images of Kannala-Brandt lenses (``OPENCV_FISHEYE``)
        are not changed. Images of other models show the widest view without empty borders, at most
        120 degrees.

    Raises
    ------
    DatasetError
        If the folder contains other files, no keyframe has an image, or distorted images have the
        rational model, which nerfstudio does not support.
    ImageError
        If an image does not fit its camera.
    MapFileError
        If `contents`, `images` or `image_names` are invalid, or the map has no keyframes.
    OSError
        If a file cannot be written; earlier files are kept then.
    """
    if not len(contents_of(contents).keyframes):
        raise MapFileError("the map has no keyframes, and nerfstudio takes no empty data; map more")
    refuse_rig(contents, "nerfstudio")
    with export_folder(folder, {"transforms.json", _POINTS, "images"}, replace=replace) as made:
        if images is None:
            views = views_without_images(contents, image_names)
            below = "" if image_names is not None else "images/"
            if not views:
                raise DatasetError("image_names names no keyframe of the map; give its keyframes")
        else:
            views, contents = write_images(
                contents, made / "images", images, progress, held=("kannala_brandt",), field=field
            )
            below = "images/"
        with atomic_write(made / "transforms.json") as stream:
            stream.write(json.dumps(_transforms(contents, views, below), indent=2) + "\n")
        write_ply(
            made / _POINTS,
            contents.points.positions @ _to_upright(contents)[:3, :3].T,
            colours=contents.point_colours(),
            unit=unit_of(contents),
            frame="world of transforms.json: z up",
        )


def _transforms(contents: MapContents, views: list[View], below: str) -> dict[str, Any]:
    T_up = _to_upright(contents)
    poses = camera_to_world(contents.keyframes.T_wc, T_up)
    frames: list[dict[str, Any]] = []
    cameras = [_camera(contents, view) for view in views]
    # Values that all images share are written once, as in files of a single camera.
    shared = cameras[0] if all(camera == cameras[0] for camera in cameras) else {}
    for view, camera in zip(views, cameras, strict=True):
        frame = {
            "file_path": f"{below}{view.name}",
            "transform_matrix": poses[view.row].tolist(),
            "colmap_im_id": int(contents.keyframes.ids[view.row]) + 1,
        }
        frames.append(frame if shared else camera | frame)
    return {
        "camera_model": "OPENCV",
        **shared,
        "ply_file_path": _POINTS,
        "applied_transform": T_up[:3].tolist(),
        "frames": frames,
    }


def camera_to_world(T_wc: FloatArray, T_up: FloatArray = _UP) -> FloatArray:
    """Convert poses (k, 4, 4) from OpenCV's axes to nerfstudio's, in the world with z up."""
    return np.asarray(T_up @ T_wc @ _OPENGL)


def _to_upright(contents: MapContents) -> FloatArray:
    """Return the transform (4, 4) to the world with z up; an IMU may have turned the map so."""
    roots = contents.keyframes.ids[contents.keyframes.parent < 0].tolist()
    return np.eye(4) if {*roots} <= {*contents.upright_roots} else _UP


def _camera(contents: MapContents, view: View) -> dict[str, float | str]:
    cameras: Cameras = contents.cameras
    row = int(contents.keyframes.camera[view.row])
    sx, sy = pixel_scale(contents, view)
    if view.pinhole is not None:
        fx, fy, cx, cy = view.pinhole.intrinsics
        names = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "p1", "p2")
        numbers = (fx, fy, cx + 0.5, cy + 0.5, *[0.0] * 5)
        return {"w": view.width, "h": view.height, **dict(zip(names, numbers, strict=True))}
    fisheye = cameras.camera_model(row)
    if fisheye is not None:
        name, own = fisheye_of(fisheye, "nerfstudio's transforms.json", {})
        return {
            "camera_model": name,
            "w": view.width,
            "h": view.height,
            "fl_x": sx * own[0],
            "fl_y": sy * own[1],
            "cx": sx * (own[2] + 0.5),
            "cy": sy * (own[3] + 0.5),
            **dict(zip(("k1", "k2", "k3", "k4"), own[4:], strict=True)),
        }
    lens = np.zeros(8) if view.undistorted else cameras.distortion[row]
    k1, k2, p1, p2, k3, *rational = lens.tolist()
    if any(rational):
        raise DatasetError(
            "nerfstudio's transforms.json cannot hold a rational lens (k4 to k6); give the images "
            "(--images, images=...), which are written undistorted"
        )
    return {
        "w": view.width,
        "h": view.height,
        "fl_x": float(sx * cameras.fx[row]),
        "fl_y": float(sy * cameras.fy[row]),
        "cx": float(sx * (cameras.cx[row] + 0.5)),
        "cy": float(sy * (cameras.cy[row] + 0.5)),
        "k1": k1,
        "k2": k2,
        "k3": k3,
        "p1": p1,
        "p2": p2,
    }
