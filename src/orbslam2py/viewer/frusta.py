# SPDX-License-Identifier: BSD-3-Clause
"""Cameras as frusta: their edges and faces, and which one is clicked."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings import CameraSettings
from orbslam2py.trajectory.rotations import quaternions_from_rotations

#: A frustum: its apex, then the corners of its image.
CORNERS = np.array([(0, 0, 0), (-1, -0.75, 0.6), (1, -0.75, 0.6), (1, 0.75, 0.6), (-1, 0.75, 0.6)])
_EDGES = np.array([(0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (2, 3), (3, 4), (4, 1)])
FACES = np.array([(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (1, 2, 3), (1, 3, 4)], np.uint32)


#: Widest frustum that is drawn, radians: a pyramid cannot show a half space.
_WIDEST = float(np.radians(120.0))


def vertical_angle(camera: CameraSettings) -> float:
    """Vertical angle of view of the frustum that shows an image [rad].

    That of a fisheye lens is between the rays at the border of the image, and at most 120 degrees.
    """
    pinhole = float(2 * np.arctan(camera.cy / camera.fy))
    if not camera.is_fisheye:
        return pinhole
    # The size may be unknown before the first image.
    width, height = (
        camera.width or max(1, round(2 * camera.cx + 1)),
        camera.height or max(1, round(2 * camera.cy + 1)),
    )
    return min(camera.camera_model(width, height).angle_of_view().vertical, _WIDEST)


def frusta(T_wc: FloatArray, size: float) -> FloatArray:
    """Edges of the frusta of cameras, (8 k, 2, 3)."""
    corners = np.einsum("kij,cj->kci", T_wc[:, :3, :3], size * CORNERS) + T_wc[:, None, :3, 3]
    return np.asarray(corners[:, _EDGES].reshape(-1, 2, 3))


def orientations(T_wc: FloatArray) -> FloatArray:
    """Orientations w, x, y, z (k, 4)."""
    return np.asarray(quaternions_from_rotations(T_wc[:, :3, :3])[:, [3, 0, 1, 2]])


def nearest_to_ray(places: FloatArray, origin: FloatArray, direction: FloatArray) -> int | None:
    """Return the row of the position with the smallest angle to a ray, in front of its origin."""
    if not len(places):
        return None
    away = places - origin
    along = away @ (direction / np.linalg.norm(direction))
    cosine = along / np.maximum(np.linalg.norm(away, axis=1), 1e-12)
    return int(np.argmax(cosine))
