# SPDX-License-Identifier: BSD-3-Clause
"""A first camera and the poses of the board, from its corners alone, for any angle of view.

An equidistant lens (pixels proportional to the angle) of some focal length gives a ray per corner;
the plane through the rays gives the pose of the board. The focal length at which corners and board
agree best is the start of a Kannala-Brandt lens.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.bundle import (
    AdjustedScene,
    BoardScene,
    Sighting,
    adjust,
    transformed,
)
from orbslam2py.errors import DatasetError
from orbslam2py.settings.camera_model import CameraModel

#: Angles from the axis to the border of the image that are tried [degrees].
_HALF_ANGLES = (12, 18, 25, 33, 42, 52, 63, 75, 87, 98, 110, 125)
#: Views with which the angles are compared, and angles that are refined.
_COMPARED, _REFINED = 12, 3


def kannala_brandt_start(sightings: Sequence[Sighting], size: tuple[int, int]) -> AdjustedScene:
    """Calibrate a Kannala-Brandt lens from nothing but corners.

    Parameters
    ----------
    sightings
        Of one camera, moments 0, 1 and so on.
    size
        Width and height of the images [pixels].

    Raises
    ------
    DatasetError
        If the views determine no camera.
    """
    best: AdjustedScene | None = None
    for camera in _ranked(sightings, size)[:_REFINED]:
        found = _refined(camera, sightings)
        if found is not None and (best is None or found.rms < best.rms):
            best = found
    if best is None or not np.isfinite(best.rms):
        raise DatasetError("the views determine no camera: slant the board, and move it more")
    return best


def _ranked(sightings: Sequence[Sighting], size: tuple[int, int]) -> list[CameraModel]:
    """Equidistant cameras, the one that explains the views best first."""
    some = sightings[:: max(1, len(sightings) // _COMPARED)]
    middle = (size[0] - 1) / 2, (size[1] - 1) / 2
    scored = []
    for degrees in _HALF_ANGLES:
        focal = max(size) / 2 / np.radians(degrees)
        camera = CameraModel("kannala_brandt", (focal, focal, *middle, 0, 0, 0, 0), size)
        errors = [_error(camera, one) for one in some]
        scored.append((float(np.median(errors)), camera))
    scored.sort(key=lambda one: one[0])
    return [camera for error, camera in scored if np.isfinite(error)]


def _error(camera: CameraModel, sighting: Sighting) -> float:
    T = board_pose(camera, sighting)
    if T is None:
        return float("inf")
    return float(np.median(np.linalg.norm(_residuals(camera, T, sighting), axis=1)))


def _residuals(camera: CameraModel, T_cb: FloatArray, sighting: Sighting) -> FloatArray:
    return np.nan_to_num(
        sighting.corners - camera.project(transformed(T_cb, sighting.points)), nan=1e3
    )


def _refined(camera: CameraModel, sightings: Sequence[Sighting]) -> AdjustedScene | None:
    poses = [board_pose(camera, one) for one in sightings]
    if any(T is None for T in poses):
        return None
    scene = BoardScene((camera,), (np.eye(4),), tuple(T for T in poses if T is not None))
    scene = adjust(scene, sightings, free=("fx", "fy", "k1"), iterations=15).scene
    scene = adjust(scene, sightings, free=("fx", "fy", "cx", "cy", "k1", "k2")).scene
    return adjust(scene, sightings)


def board_pose(camera: CameraModel, sighting: Sighting) -> FloatArray | None:
    """Pose of the board (4, 4) by the rays of its corners; None if they determine none.

    The direct linear transform of a homography from the board to rays, in which no ray needs to
    point forward (R. Hartley, A. Zisserman, "Multiple view geometry", section 4.1).
    """
    rays = camera.unproject(sighting.corners)
    known = np.isfinite(rays).all(axis=1)
    if known.sum() < 4:
        return None
    rays, points = rays[known], sighting.points[known, :2]
    middle, scale = points.mean(axis=0), float(np.abs(points - points.mean(axis=0)).max())
    plane = np.column_stack([(points - middle) / scale, np.ones(len(points))])
    # ray x (H p) = 0, with the entries of H row by row.
    rows = np.einsum("nij,nk->nijk", _cross_matrices(rays), plane).reshape(-1, 9)
    H = np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(3, 3)
    if np.median(((plane @ H.T) * rays).sum(axis=1)) < 0:
        H = -H
    H = H @ np.array(
        [[1 / scale, 0, -middle[0] / scale], [0, 1 / scale, -middle[1] / scale], [0, 0, 1]]
    )
    lengths = np.linalg.norm(H[:, :2], axis=0)
    if not (np.isfinite(lengths).all() and lengths.min() > 0):
        return None
    x, y = H[:, 0] / lengths[0], H[:, 1] / lengths[1]
    U, _, Vt = np.linalg.svd(np.column_stack([x, y, np.cross(x, y)]))
    T = np.eye(4)
    T[:3, :3] = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    T[:3, 3] = H[:, 2] / np.sqrt(lengths[0] * lengths[1])
    return T


def _cross_matrices(rays: FloatArray) -> FloatArray:
    x, y, z = rays.T
    zero = np.zeros(len(rays))
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
