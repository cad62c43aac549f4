# SPDX-License-Identifier: BSD-3-Clause
"""Images of any camera model, composed of pinhole images of the sides of a cube."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.settings.camera_model import CameraModel

#: Grey values uint8 (n, n) and depth along z float32 (n, n) of a square pinhole image, from the
#: rotation (3, 3) of the camera to the side, the focal length [px] and the size n [px].
RenderSide = Callable[[FloatArray, float, int], tuple[ByteArray, NDArray[np.float32]]]

#: Pixels of a side per pixel of the image, in the middle of the latter.
_FINER = 1.5
#: Pixels by which a side reaches beyond its 90 degrees, for interpolation.
_MARGIN = 2
#: Directions of the sides in the camera frame: to the front, right, left, below, above, behind.
_SIDES = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, -1]], np.float64)


class _Side(NamedTuple):
    R_sc: FloatArray
    """Camera to side, (3, 3)."""
    mask: NDArray[np.bool_]
    """Pixels of the image that this side shows, (h, w)."""
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    """Their pixels in the side, (h, w)."""
    z: NDArray[np.float32]
    """Depth along the camera's axis per depth along that of the side, (h, w)."""


class WideView:
    """Renders the image of a camera model.

    Parameters
    ----------
    model
        Of the images. Pixels outside the domain of the model are black and have no depth.
    """

    def __init__(self, model: CameraModel) -> None:
        width, height = model.image_size
        y, x = np.indices((height, width), dtype=np.float64)
        pixels = np.stack([x.ravel(), y.ravel()], axis=1)
        rays = np.asarray(model.unproject(pixels))
        centre = np.array([[(width - 1) / 2, (height - 1) / 2]])
        self._focal_length = _FINER * float(np.ravel(model.pixels_per_radian(centre))[0])
        self._size = 2 * (int(np.ceil(self._focal_length)) + _MARGIN)
        shown = np.all(np.isfinite(rays), axis=1)
        toward = np.where(shown[:, None], rays, 0.0) @ _SIDES.T
        nearest = np.where(shown, np.argmax(toward, axis=1), -1)
        self._shape = (height, width)
        self._sides = [
            self._side(number, rays, nearest == number)
            for number in range(len(_SIDES))
            if np.any(nearest == number)
        ]

    def _side(self, number: int, rays: FloatArray, mask: NDArray[np.bool_]) -> _Side:
        z = _SIDES[number]
        x = np.array([0.0, 0.0, 1.0]) if abs(z[0]) > 0.5 else np.array([1.0, 0.0, 0.0])
        R_sc = np.stack([x, np.cross(z, x), z])
        in_side = np.where(mask[:, None], rays, z) @ R_sc.T
        middle = (self._size - 1) / 2
        u, v = (self._focal_length * in_side[:, i] / in_side[:, 2] + middle for i in (0, 1))
        along = np.where(mask, rays[:, 2], 1.0) / in_side[:, 2]
        return _Side(
            R_sc,
            mask.reshape(self._shape),
            *(values.reshape(self._shape).astype(np.float32) for values in (u, v, along)),
        )

    def render(self, render_side: RenderSide) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Put the image together.

        Parameters
        ----------
        render_side
            Renders a side without noise.

        Returns
        -------
        array (h, w), array (h, w)
            Grey levels, and depth along z [m]: 0 where no surface is hit, or beside the camera.
        """
        image = np.zeros(self._shape, np.float32)
        depth = np.zeros(self._shape, np.float32)
        for side in self._sides:
            grey, side_depth = render_side(side.R_sc, self._focal_length, self._size)
            values = cv2.remap(grey.astype(np.float32), side.x, side.y, cv2.INTER_LINEAR)
            # Depths of two things are not mixed at an edge.
            nearest = cv2.remap(side_depth, side.x, side.y, cv2.INTER_NEAREST)
            image[side.mask] = values[side.mask]
            depth[side.mask] = np.maximum(nearest * side.z, 0.0)[side.mask]
        return image, depth
