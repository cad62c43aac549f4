# SPDX-License-Identifier: BSD-3-Clause
"""Registration of depth: from the pixels of the depth camera to those of the colour camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import ImageError
from orbslam2py.settings.projection import distorted

#: A hole of one pixel is filled if at least this number of its eight neighbours have depth.
_NEIGHBOURS = 4
#: They may differ by no more than this part of their depth: edges of things stay open.
_SAME_SURFACE = 0.05
#: Points are projected up to this much beyond the corners of the image: a distortion polynomial
#: may lead points from far outside back into it.
_MARGIN = 1.1
#: More pixels than this, in each direction, are not covered by one pixel of depth.
_WIDEST = 16
#: Number of pixels of depth that are projected at once: their results stay in the cache.
_AT_ONCE = 1 << 15
#: Steps that undo a distortion.
_STEPS = 30


@dataclass(frozen=True, eq=False)
class Lens:
    """The map from rays to the pixels of a camera.

    Attributes
    ----------
    K
        Camera matrix (3, 3) [pixels].
    D
        Distortion k1, k2, p1, p2 and, if there are more, k3 to k6, in OpenCV's order.
    size
        Width and height [pixels].
    """

    K: FloatArray
    D: FloatArray
    size: tuple[int, int]


class DepthRegistration:
    """Registers images of a depth camera to a colour camera beside it.

    Each pixel of depth is a small square in front of the colour camera: it covers all pixels whose
    centres it contains, so that a finer colour image has no holes. Of several depths at one pixel
    the nearest one is kept.

    Parameters
    ----------
    depth, colour
        The two cameras.
    T_colour_depth
        Transform (4, 4) from the coordinates of the depth camera to those of the colour camera [m].
    units_per_metre
        Units of the depth images per metre.
    """

    def __init__(
        self, depth: Lens, colour: Lens, T_colour_depth: FloatArray, units_per_metre: float
    ) -> None:
        R = T_colour_depth[:3, :3]
        self._depth_size = depth.size
        self._colour = colour
        self._rays = (R @ _rays_of(depth)).astype(np.float32)
        self._t = (T_colour_depth[:3, 3:] * units_per_metre).astype(np.float32)
        K = colour.K.astype(np.float32)
        self._pinhole = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
        # Half the side of a pixel of depth, seen from the colour camera at the same distance.
        side = 0.5 / np.array([depth.K[0, 0], depth.K[1, 1]])
        half = np.abs(R[:2, :2]) @ side * [colour.K[0, 0], colour.K[1, 1]]
        self._half = half.astype(np.float32)
        corners = _rays_of(colour, corners=True)[:2]
        self._reach = np.float32(_MARGIN**2 * np.square(corners).sum(axis=0).max())

    def register(self, depth: NDArray[np.generic]) -> NDArray[np.float32]:
        """Compute the depth at the pixels of the colour camera.

        Parameters
        ----------
        depth
            Image (h, w) of the depth camera; 0, NaN and infinity mean no depth.

        Returns
        -------
        NDArray[np.float32]
            Depth along the axis of the colour camera, in its size and the same units; 0 means no
            depth.

        Raises
        ------
        ImageError
            If the size is not that of the depth camera.
        """
        width, height = self._depth_size
        if depth.shape != (height, width):
            shape = " x ".join(map(str, depth.shape[::-1]))
            raise ImageError(
                f"depth is {shape}, but the calibration of its camera is for {width} x {height}"
            )
        columns, rows = self._colour.size
        drawn = np.full(columns * rows, np.inf, np.float32)
        pixels = depth.reshape(-1)
        for begin in range(0, pixels.size, _AT_ONCE):
            part = slice(begin, begin + _AT_ONCE)
            self._draw(np.asarray(pixels[part], np.float32), self._rays[:, part], drawn)
        return _fill_holes(drawn.reshape(rows, columns))

    def _draw(
        self, raw: NDArray[np.float32], rays: NDArray[np.float32], drawn: NDArray[np.float32]
    ) -> None:
        """Transform points into the coordinates of the colour camera, and draw their squares."""
        known = (raw > 0) & (raw < np.inf)
        if not known.all():
            raw, rays = raw[known], rays[:, known]
        X, Y, Z = rays * raw + self._t
        if (Z <= 0).any():
            ahead = Z > 0
            raw, X, Y, Z = raw[ahead], X[ahead], Y[ahead], Z[ahead]
        x, y = X / Z, Y / Z
        if self._colour.D.any():
            inside = x * x + y * y < self._reach
            raw, Z = raw[inside], Z[inside]
            x, y = distorted(np.stack([x[inside], y[inside]], axis=1), self._colour.D).T
        width, height = self._colour.size
        fx, fy, cx, cy = self._pinhole
        scale = raw / Z
        u0, u1 = _centres_in(fx * x + cx, self._half[0] * scale, width)
        v0, v1 = _centres_in(fy * y + cy, self._half[1] * scale, height)
        wide, high = u1 - u0, v1 - v0
        first = v0 * np.int32(width) + u0
        for down in range(int(high.max(initial=-1)) + 1):
            for along in range(int(wide.max(initial=-1)) + 1):
                covered = np.flatnonzero((wide >= along) & (high >= down))
                at = first[covered] + np.int32(down * width + along)
                np.minimum.at(drawn, at, Z[covered])


def _centres_in(
    middle: NDArray[np.float32], half: NDArray[np.float32], size: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the first and last pixel whose centre is in [middle - half, middle + half)."""
    half = np.minimum(half, np.float32(_WIDEST / 2))
    first = np.clip(np.ceil(middle - half), 0, size).astype(np.int32)
    last = np.clip(np.ceil(middle + half) - 1, -1, size - 1).astype(np.int32)
    return first, last


def _fill_holes(drawn: NDArray[np.float32]) -> NDArray[np.float32]:
    """Fill single pixels inside a surface, and write 0 where there is no depth."""
    hole = np.isinf(drawn)
    drawn[hole] = 0
    known = (~hole).view(np.uint8)
    around = cv2.boxFilter(known, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    rows, columns = np.nonzero(hole & (around >= _NEIGHBOURS))
    if not len(rows):
        return drawn
    framed = np.pad(drawn, 1)
    near = np.stack([framed[rows + i, columns + j] for i in range(3) for j in range(3)])
    most = near.max(axis=0)
    least = np.where(near > 0, near, np.inf).min(axis=0)
    same = most - least < _SAME_SURFACE * least
    mean = near.sum(axis=0) / (near > 0).sum(axis=0)
    drawn[rows[same], columns[same]] = mean[same]
    return drawn


def _rays_of(lens: Lens, *, corners: bool = False) -> FloatArray:
    """Return rays (3, n) with z = 1 of all pixels in memory order, or of the corners."""
    width, height = lens.size
    us, vs = ([0, width - 1], [0, height - 1]) if corners else (np.arange(width), np.arange(height))
    u, v = (grid.ravel().astype(np.float64) for grid in np.meshgrid(us, vs))
    seen_y = (v - lens.K[1, 2]) / lens.K[1, 1]
    seen_x = (u - lens.K[0, 2] - lens.K[0, 1] * seen_y) / lens.K[0, 0]
    seen = np.stack([seen_x, seen_y], axis=1)
    plane = seen
    for _ in range(_STEPS if lens.D.any() else 0):
        plane = plane + seen - distorted(plane, lens.D)
    return np.vstack([plane.T, np.ones_like(u)])
