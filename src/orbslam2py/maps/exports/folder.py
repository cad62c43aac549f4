# SPDX-License-Identifier: BSD-3-Clause
"""The folder of an export, and its images without distortion."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Collection, Iterator
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arguments import path_of
from orbslam2py._arrays import ByteArray
from orbslam2py._files import atomic_folder, atomic_write, failing_as
from orbslam2py.errors import DatasetError, MapFileError
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.exports.colours import ColourSampler
from orbslam2py.maps.exports.images import (
    ImageOfKeyframe,
    Progress,
    View,
    image_name,
    image_of_row,
)
from orbslam2py.maps.exports.pinhole_views import (
    PinholeView,
    checked_field,
    pinhole_view,
    scaled_camera,
)

_log = logging.getLogger(__name__)


@contextlib.contextmanager
def export_folder(folder: str | Path, made_of: set[str], *, replace: bool) -> Iterator[Path]:
    """Make the folder of an export; it appears only after all files are written.

    Parameters
    ----------
    folder
        The folder: new, empty, or with `replace` an earlier export.
    made_of
        Files and folders of this kind of export; a folder with anything else is not replaced.
    replace
        Replace an earlier export.

    Raises
    ------
    DatasetError
        If the folder contains other files.
    OSError
        If it cannot be written.
    """
    folder = path_of(folder, "the folder of the export")
    if folder.exists() and not folder.is_dir():
        raise DatasetError(f"{folder} is not a folder; give another one")
    held = {path.name for path in folder.iterdir()} if folder.exists() else set()
    if held and not replace:
        raise DatasetError(
            f"{folder} is not empty; give another folder, or ask for an earlier export to be "
            "replaced (--force, replace=True)"
        )
    if held - made_of:
        raise DatasetError(
            f"{folder} holds other files ({min(held - made_of)}), which would be lost; give "
            "another folder"
        )
    with atomic_folder(folder) as made, failing_as(folder, made):
        yield made


def write_images(
    contents: MapContents,
    folder: Path,
    images: ImageOfKeyframe,
    progress: Progress | None = None,
    *,
    held: Collection[str] = (),
    field: float | None = None,
) -> tuple[list[View], MapContents]:
    """Write the keyframes' images as PNG files of a pinhole camera.

    Those of fisheye cameras that the format can hold stay as they are; of others a pinhole view is
    cut out. Of pinhole cameras the camera keeps its matrix; parts beyond the image are cut off, and
    parts without pixels are black. Images of another size than the camera's (small copies) are
    taken for scaled ones.

    Parameters
    ----------
    contents
        The map.
    folder
        The folder; it is created if needed.
    images
        The source of the images; keyframes without an image are left out.
    progress
        Called after every keyframe.
    held
        Names of the fisheye models that the format can hold.
    field
        Angle of view of the pinhole views in the longer direction [degrees], also of the models
        that the format can hold. None: the widest without empty borders, at most 120 degrees.

    Returns
    -------
    views : list of View
        One per image.
    contents : MapContents
        The map, with colours from the images where there were none.

    Raises
    ------
    DatasetError
        If no keyframe has an image.
    ImageError
        If an image does not fit its camera.
    OSError
        If a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pinholes = _PinholesOfFisheyes(contents, held, field)
    views = []
    sampler = ColourSampler(contents)
    ids = contents.keyframes.ids.tolist()
    for row, number in enumerate(ids):
        image = image_of_row(contents, row, images)
        if image is not None:
            sampler.look_at(row, image)
            height, width = image.shape[:2]
            pinhole = pinholes.of(row, width, height)
            straight = (
                _undistorted(contents, row, image) if pinhole is None else pinhole.render(image)
            )
            _write_png(folder / image_name(number), straight)
            fisheye = contents.cameras.model[contents.keyframes.camera[row]] != 0
            undistorted = pinhole is not None or not fisheye
            views.append(View(row, image_name(number), width, height, undistorted, pinhole))
        if progress is not None:
            progress(row + 1, len(ids))
    if not views:
        raise DatasetError(
            "no keyframe has an image; give the sequence that the map was made of, or leave the "
            "images out"
        )
    return views, sampler.coloured()


def refuse_rig(contents: MapContents, what: str) -> None:
    """Raise `MapFileError` for a map of a rig, whose keyframes have several images."""
    if contents.cameras.has_rigs:
        raise MapFileError(
            f"{what} cannot be made of the map of a rig yet: its keyframes have several images. "
            "Points (ply, pcd), poses of the body (tum, kitti) and g2o can be exported"
        )


class _PinholesOfFisheyes:
    """Pinhole views for fisheye cameras that a format cannot hold, made and reported once."""

    def __init__(self, contents: MapContents, held: Collection[str], field: float | None) -> None:
        self._contents, self._held = contents, held
        self._field = None if field is None else checked_field(field)
        self._views: dict[tuple[int, int, int], PinholeView] = {}

    def of(self, row: int, width: int, height: int) -> PinholeView | None:
        """The view for the image of a keyframe; None if its camera needs none."""
        number = int(self._contents.keyframes.camera[row])
        model = self._contents.cameras.camera_model(number)
        if model is None or (self._field is None and model.name in self._held):
            return None
        key = number, width, height
        if key not in self._views:
            view = pinhole_view(scaled_camera(model, width, height), self._field)
            self._views[key] = view
            wide, high = view.field
            why = "" if model.name in self._held else ", which the format cannot hold"
            _log.warning(
                "the camera has a lens of the model %s%s: the images are written as a pinhole "
                "sees them, %.0f x %.0f degrees (--field sets the longer angle)",
                model.name,
                why,
                wide,
                high,
            )
        return self._views[key]


def _undistorted(contents: MapContents, row: int, image: ByteArray) -> ByteArray:
    cameras, camera = contents.cameras, int(contents.keyframes.camera[row])
    distortion = cameras.distortion[camera]
    if not np.any(distortion):
        return image
    x = image.shape[1] / int(cameras.width[camera])
    y = image.shape[0] / int(cameras.height[camera])
    # Scaling an image moves the centre of a pixel: it stays at half a pixel from the edge.
    K = np.array(
        [
            [x * cameras.fx[camera], 0.0, x * (cameras.cx[camera] + 0.5) - 0.5],
            [0.0, y * cameras.fy[camera], y * (cameras.cy[camera] + 0.5) - 0.5],
            [0.0, 0.0, 1.0],
        ]
    )
    return np.asarray(cv2.undistort(image, K, distortion), np.uint8)


def _write_png(path: Path, image: ByteArray) -> None:
    shown = image if image.ndim == 2 else image[:, :, ::-1]
    _, content = cv2.imencode(".png", shown)
    with atomic_write(path, binary=True) as stream:
        stream.write(content.tobytes())
