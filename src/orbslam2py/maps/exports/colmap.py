# SPDX-License-Identifier: BSD-3-Clause
"""Maps as COLMAP models, for Gaussian splatting and structure from motion."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._files import atomic_write
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.colmap_model import (
    COLMAP_LENSES,
    MODEL_IDS,
    ColmapCamera,
    ColmapImage,
    ColmapModel,
    ColmapPoints,
    colmap_model,
)
from orbslam2py.maps.exports.folder import export_folder, refuse_rig, write_images
from orbslam2py.maps.exports.images import ImageOfKeyframe, Progress, View, views_without_images


def export_colmap(
    contents: MapContents,
    folder: str | Path,
    *,
    images: ImageOfKeyframe | None = None,
    image_names: Mapping[int, str | Path] | None = None,
    binary: bool = True,
    replace: bool = False,
    progress: Progress | None = None,
    field: float | None = None,
) -> None:
    """Write a map as a COLMAP model: ``sparse/0`` and, if they are given, ``images``.

    Poses are world to camera with quaternions w, x, y, z. The centre of the top-left pixel is (0.5,
    0.5), half a pixel more than in this package ("Output format" in COLMAP's documentation). Ids
    are those of keyframes and points, plus 1. Images contain all keypoints of their keyframe, so
    the numbers of keypoints do not change.

    Parameters
    ----------
    contents
        The map; the unit of length does not change (one camera: the map's own).
    folder
        The folder: new, empty, or with `replace` an earlier export.
    images
        Where the keyframes' images come from (`images_of`): they are written without the lens'
        distortion, for cameras of the model ``PINHOLE``; keyframes without one are left out.
        Without `images` none are written, and the cameras are those that took them: ``PINHOLE``,
        ``OPENCV`` (k1, k2, p1, p2) or ``FULL_OPENCV`` (k3 as well). Fisheye cameras are
        ``OPENCV_FISHEYE`` (Kannala-Brandt) or ``FOV`` in either case; the `images` of other models
        become those of a pinhole.
    image_names
        Names of existing images by keyframe id, if `images` is not given; keyframes without a name
        are left out. By default ``keyframe_000012.png`` and so on. Names with spaces need ``.bin``
        files, because COLMAP reads names in text files up to the first space.
    binary
        Write ``.bin`` files, otherwise text files.
    replace
        Replace an earlier export.
    progress
        ``progress(done, total)`` after every image.
    field
        Fisheye cameras: write `images` as a pinhole sees them, with this angle of view in the
        longer direction [degrees]. By default, images of models that COLMAP has are not changed.
        Images of other models show the widest view without empty borders, at most 120 degrees.
        Keypoints beside that view are at (0, 0) and belong to no point.

    Raises
    ------
    DatasetError
        If the folder contains other files, or no keyframe has an image.
    ImageError
        If an image does not fit its camera.
    MapFileError
        If `contents`, `images` or `image_names` are invalid, or COLMAP could not read a name.
    OSError
        If a file cannot be written; earlier files are kept then.

    Examples
    --------
    >>> export_colmap(contents, "desk", images=images_of(contents, sequence))  # doctest: +SKIP
    """
    contents_of(contents)
    refuse_rig(contents, "A COLMAP model")
    with export_folder(folder, {"sparse", "images"}, replace=replace) as made:
        if images is None:
            views = views_without_images(contents, image_names)
            if not binary:
                _check_names(contents, views)
        else:
            views, contents = write_images(
                contents, made / "images", images, progress, held=COLMAP_LENSES, field=field
            )
        sparse = made / "sparse" / "0"
        sparse.mkdir(parents=True)
        model = colmap_model(contents, views)
        if binary:
            _write_binary(sparse, model)
        else:
            _write_text(sparse, model)


# ---- text ----------------------------------------------------------------------------------------
#: Of C, which COLMAP goes by; others are letters to it.
_SPACES = frozenset(" \t\n\v\f\r")


def _check_names(contents: MapContents, views: list[View]) -> None:
    for view in views:
        if not _SPACES.isdisjoint(view.name):
            number = int(contents.keyframes.ids[view.row])
            raise MapFileError(
                f"image_names[{number}] is {shown(view.name)}, which COLMAP reads up to the space "
                "in a text file; give another name, or write .bin files (binary=True)"
            )


def _write_text(folder: Path, model: ColmapModel) -> None:
    with atomic_write(folder / "cameras.txt") as stream:
        stream.write("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n")
        for camera in model.cameras:
            numbers = " ".join(map(repr, camera.parameters.tolist()))
            words = f"{camera.camera_id} {camera.model} {camera.width} {camera.height}"
            stream.write(f"{words} {numbers}\n")
    with atomic_write(folder / "images.txt") as stream:
        stream.write(
            "# two lines per image:\n"
            "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
            "# POINTS2D[] as (X, Y, POINT3D_ID)\n"
        )
        for image in model.images:
            pose = [*image.quaternion.tolist(), *image.translation.tolist()]
            numbers = " ".join(map(repr, pose))
            stream.write(f"{image.image_id} {numbers} {image.camera_id} {image.name}\n")
            stream.write(_points2d_text(image) + "\n")
    with atomic_write(folder / "points3D.txt") as stream:
        stream.write("# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n")
        stream.writelines(_points3d_lines(model.points))


def _points2d_text(image: ColmapImage) -> str:
    n = len(image.point_ids)
    table = np.column_stack([image.pixels, image.point_ids])  # ids are below 2^53
    # One formatting operation for all keypoints: a loop over them would take seconds.
    return (" ".join(["%.9g %.9g %d"] * n)) % tuple(table.ravel().tolist())


def _points3d_lines(points: ColmapPoints) -> list[str]:
    tracks = np.column_stack([points.track_images, points.track_keypoints])
    rows = zip(
        points.ids.tolist(),
        points.positions.tolist(),
        points.colours.tolist(),
        points.errors.tolist(),
        pairwise(points.offsets.tolist()),
        strict=True,
    )
    return [
        f"{number} {x!r} {y!r} {z!r} {red} {green} {blue} {error!r} "
        f"{' '.join(map(str, tracks[first:last].ravel().tolist()))}\n"
        for number, (x, y, z), (red, green, blue), error, (first, last) in rows
    ]


# ---- binary --------------------------------------------------------------------------------------
_CAMERA_HEAD = np.dtype([("id", "<u4"), ("model", "<i4"), ("width", "<u8"), ("height", "<u8")])
_IMAGE_HEAD = np.dtype([("id", "<u4"), ("q", "<f8", 4), ("t", "<f8", 3), ("camera", "<u4")])
_KEYPOINT = np.dtype([("x", "<f8"), ("y", "<f8"), ("point", "<i8")])
_POINT_HEAD = np.dtype(
    [("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8"), ("length", "<u8")]
)
_TRACK = np.dtype([("image", "<u4"), ("keypoint", "<u4")])


def _write_binary(folder: Path, model: ColmapModel) -> None:
    with atomic_write(folder / "cameras.bin", binary=True) as stream:
        stream.write(_count(len(model.cameras)))
        for camera in model.cameras:
            stream.write(_camera_bytes(camera))
    with atomic_write(folder / "images.bin", binary=True) as stream:
        stream.write(_count(len(model.images)))
        for image in model.images:
            stream.write(_image_bytes(image))
    with atomic_write(folder / "points3D.bin", binary=True) as stream:
        stream.write(_count(len(model.points)))
        stream.write(_points_bytes(model.points))


def _count(n: int) -> bytes:
    return np.array(n, "<u8").tobytes()


def _camera_bytes(camera: ColmapCamera) -> bytes:
    model = MODEL_IDS[camera.model]
    head = np.array((camera.camera_id, model, camera.width, camera.height), _CAMERA_HEAD)
    return head.tobytes() + camera.parameters.astype("<f8").tobytes()


def _image_bytes(image: ColmapImage) -> bytes:
    pose = (image.image_id, image.quaternion, image.translation, image.camera_id)
    keypoints = np.empty(len(image.point_ids), _KEYPOINT)
    keypoints["x"], keypoints["y"] = image.pixels.T
    keypoints["point"] = image.point_ids
    name = image.name.encode("utf-8", "surrogateescape") + b"\0"
    head = np.array(pose, _IMAGE_HEAD).tobytes()
    return head + name + _count(len(keypoints)) + keypoints.tobytes()


def _points_bytes(points: ColmapPoints) -> bytes:
    """The track of a point follows its head, so the distances between heads vary."""
    length = np.diff(points.offsets)
    heads = np.empty(len(points), _POINT_HEAD)
    heads["id"], heads["xyz"], heads["rgb"] = points.ids, points.positions, points.colours
    heads["error"], heads["length"] = points.errors, length
    tracks = np.empty(len(points.track_images), _TRACK)
    tracks["image"], tracks["keypoint"] = points.track_images, points.track_keypoints
    head, member = _POINT_HEAD.itemsize, _TRACK.itemsize
    content = np.empty(len(heads) * head + len(tracks) * member, np.uint8)
    begin = np.arange(len(heads)) * head + points.offsets[:-1] * member
    content[begin[:, None] + np.arange(head)] = heads.view(np.uint8).reshape(-1, head)
    place = (np.repeat(np.arange(len(heads)), length) + 1) * head
    place = place + np.arange(len(tracks)) * member
    content[place[:, None] + np.arange(member)] = tracks.view(np.uint8).reshape(-1, member)
    return content.tobytes()
