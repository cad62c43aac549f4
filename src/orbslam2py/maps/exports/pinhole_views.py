# SPDX-License-Identifier: BSD-3-Clause
"""Pinhole views of wide lenses, for formats that cannot hold the lens."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from orbslam2py._arguments import finite_number
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.settings import CameraModel

#: Widest view that is chosen, in the longer direction [degrees]: a pinhole stretches the border.
_WIDEST = 120.0
#: Views that may be asked for [degrees].
_LEAST_FIELD, _MOST_FIELD = 10.0, 160.0
_BISECTIONS = 40
_BORDER_POINTS = 50


@dataclass(frozen=True, eq=False)
class PinholeView:
    """Pinhole views, without distortion, of the images of another camera.

    Attributes
    ----------
    camera
        The camera of the image.
    focal
        Focal length of the pinhole [pixels]; its image has the size of the camera's, and the
        principal point in the middle.
    """

    camera: CameraModel
    focal: float

    @property
    def intrinsics(self) -> tuple[float, float, float, float]:
        """fx, fy, cx, cy [pixels]; the centre of the top-left pixel is (0, 0)."""
        width, height = self.camera.image_size
        return self.focal, self.focal, (width - 1) / 2, (height - 1) / 2

    @property
    def field(self) -> tuple[float, float]:
        """Horizontal and vertical angle of view [degrees]."""
        width, height = self.camera.image_size
        wide, high = (np.degrees(2 * np.arctan(side / 2 / self.focal)) for side in (width, height))
        return float(wide), float(high)

    def pixels_of(self, pixels: FloatArray) -> FloatArray:
        """Where the pinhole shows what the camera shows at pixels (n, 2).

        NaN beside the image of the pinhole.
        """
        fx, fy, cx, cy = self.intrinsics
        rays = self.camera.unproject(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = rays[:, :2] / rays[:, 2:] * (fx, fy) + (cx, cy)
        width, height = self.camera.image_size
        inside = (rays[:, 2] > 0) & (found >= -0.5).all(axis=1)
        inside &= (found < (width - 0.5, height - 0.5)).all(axis=1)
        return np.where(inside[:, None], found, np.nan)

    @cached_property
    def _maps(self) -> tuple[FloatArray, FloatArray]:
        width, height = self.camera.image_size
        v, u = np.indices((height, width), dtype=np.float64)
        shown = self.camera.project(self._rays(np.stack([u.ravel(), v.ravel()], axis=1)))
        shown = np.nan_to_num(shown, nan=-1e4).astype(np.float32)
        return shown[:, 0].reshape(height, width), shown[:, 1].reshape(height, width)

    def _rays(self, pixels: FloatArray) -> FloatArray:
        fx, fy, cx, cy = self.intrinsics
        return np.column_stack([(pixels - (cx, cy)) / (fx, fy), np.ones(len(pixels))])

    def is_full(self) -> bool:
        """Whether the camera's image has something for every pixel."""
        width, height = self.camera.image_size
        u, v = np.linspace(0, width - 1, _BORDER_POINTS), np.linspace(0, height - 1, _BORDER_POINTS)
        border = [
            *(np.column_stack([u, np.full_like(u, y)]) for y in (0, height - 1)),
            *(np.column_stack([np.full_like(v, x), v]) for x in (0, width - 1)),
        ]
        shown = self.camera.project(self._rays(np.concatenate(border)))
        return bool(
            np.isfinite(shown).all()
            and (shown >= 0).all()
            and (shown <= np.array([width - 1, height - 1])).all()
        )

    def render(self, image: ByteArray) -> ByteArray:
        """Resample an image of the camera; black where the camera shows nothing."""
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), np.uint8)


def pinhole_view(camera: CameraModel, field: float | None) -> PinholeView:
    """Choose the pinhole for a camera.

    Parameters
    ----------
    camera
        The camera of the images.
    field
        Angle of view in the longer direction [degrees], with black borders if the camera shows
        less. None: the widest view without empty borders, at most 120 degrees.

    Raises
    ------
    DatasetError
        If the angle is out of range, or no view is free of empty borders.
    """
    longer = max(camera.image_size)

    def of(degrees: float) -> PinholeView:
        return PinholeView(camera, longer / 2 / float(np.tan(np.radians(degrees) / 2)))

    if field is not None:
        return of(checked_field(field))
    low, high = _LEAST_FIELD, _WIDEST
    if not of(low).is_full():
        raise DatasetError(
            f"no pinhole view of the {camera.name} lens is without empty borders; give the angle "
            "of view of the images (--field 90)"
        )
    if of(high).is_full():
        return of(high)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if of(middle).is_full() else (low, middle)
    return of(low)


def checked_field(field: float) -> float:
    """Check a given angle of view [degrees].

    Raises
    ------
    DatasetError
        If it is out of range.
    """
    wanted = f"degrees from {_LEAST_FIELD:g} to {_MOST_FIELD:g}"
    value = finite_number(field, "the field of view of the images", wanted, DatasetError)
    if not _LEAST_FIELD <= value <= _MOST_FIELD:
        raise DatasetError(f"the field of view of the images is {value:g}; give {wanted}")
    return value


def scaled_camera(camera: CameraModel, width: int, height: int) -> CameraModel:
    """The camera of images that were scaled to another size."""
    sx, sy = width / camera.image_size[0], height / camera.image_size[1]
    fx, fy, cx, cy, *lens = camera.parameters
    # Scaling an image moves the centre of a pixel: it stays at half a pixel from the edge.
    plane = (sx * fx, sy * fy, sx * (cx + 0.5) - 0.5, sy * (cy + 0.5) - 0.5)
    return CameraModel(camera.name, (*plane, *lens), (width, height))
