# SPDX-License-Identifier: BSD-3-Clause
"""How a pair of images lies: rows, or epipolar curves, and disparities of the same points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.calibration.tracks import find_corners, follow_points
from orbslam2py.calibration.two_views import PointPair, without_gross_errors
from orbslam2py.settings import Settings

#: How often the images are halved to search: disparities are larger than motions.
_HALVINGS = 5
_N_CORNERS, _LEAST = 300, 40
#: Disparities below minus this are of the wrong sign; smaller ones are noise of far points [px].
_NOISE = 1.0
#: Sine of the angle from the baseline below which a ray has no certain epipolar plane.
_LEAST_SINE = 0.2


@dataclass(frozen=True)
class PairRows:
    """How rows and columns of the same points differ.

    Attributes
    ----------
    n_points
        Points found in both images.
    row_difference
        Median distance of their rows, pixels.
    wrong_sign
        Part of them with a disparity below that of infinity.
    """

    n_points: int
    row_difference: float
    wrong_sign: float


def measure_rows(left: ByteArray, right: ByteArray) -> PairRows | None:
    """Compare the rows of corners of the left image with where they are in the right one.

    Parameters
    ----------
    left, right : array of uint8, (h, w)
        Grey images of a rectified pair.

    Returns
    -------
    PairRows or None
        None if too few points were found to say anything.
    """
    begin = find_corners(left, _N_CORNERS)
    end, found = follow_points(left, right, begin, halvings=_HALVINGS)
    pair = without_gross_errors(PointPair(begin[found], end[found]))
    if pair is None or len(pair.first) < _LEAST:
        return None
    apart = pair.first - pair.second
    return PairRows(
        n_points=len(apart),
        row_difference=float(np.median(np.abs(apart[:, 1]))),
        wrong_sign=float(np.mean(apart[:, 0] < -_NOISE)),
    )


def measure_curves(left: ByteArray, right: ByteArray, settings: Settings) -> PairRows | None:
    """Compare corners of the left image with where the right camera of a fisheye pair sees them.

    Parameters
    ----------
    left, right : array of uint8, (h, w)
        Grey images as the cameras take them.
    settings : Settings
        With a right camera.

    Returns
    -------
    PairRows or None
        The row difference is the distance from the epipolar curve. None if too few points were
        found to say anything.
    """
    assert settings.right is not None
    size = left.shape[1], left.shape[0]
    begin = find_corners(left, _N_CORNERS)
    end, found = follow_points(left, right, begin, halvings=_HALVINGS)
    rays = settings.camera.camera_model(*size).unproject(begin[found])
    model = settings.right.camera.camera_model(*size)
    T = settings.right.T_right_left
    ends = model.unproject(end[found]) @ T[:3, :3]
    along = settings.right.centre / settings.right.baseline
    seen = np.isfinite(rays[:, 0]) & np.isfinite(ends[:, 0])
    # The epipolar plane of a left ray, and the part of the right ray that leaves it.
    normals = np.cross(along, rays)
    sines = np.linalg.norm(normals, axis=1)
    seen &= sines > _LEAST_SINE
    rays, ends, normals, sines = (one[seen] for one in (rays, ends, normals, sines))
    if len(rays) < _LEAST:
        return None
    beside = np.einsum("ij,ij->i", ends, normals) / sines
    parallax = np.arccos(np.clip(rays @ along, -1, 1))
    parallax = np.arccos(np.clip(ends @ along, -1, 1)) - parallax
    scale = model.pixels_per_radian(end[found][seen])
    return PairRows(
        n_points=len(rays),
        row_difference=float(np.median(np.abs(beside * scale))),
        wrong_sign=float(np.mean(parallax * scale < -_NOISE)),
    )


def disparities_of(left: ByteArray, right: ByteArray, points: FloatArray) -> FloatArray:
    """Disparities (n,) of points (n, 2) of the left image, pixels; 0 where none is sure."""
    there, found = follow_points(left, right, points, halvings=_HALVINGS)
    apart = points - there
    sure = found & (apart[:, 0] > 2 * _NOISE) & (np.abs(apart[:, 1]) < 2 * _NOISE)
    return np.where(sure, apart[:, 0], 0.0)
