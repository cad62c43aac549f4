# SPDX-License-Identifier: BSD-3-Clause
"""Projection of points to the image plane, through the lens.

The distortion is OpenCV's radial-tangential model (D. C. Brown, "Close-range camera calibration",
1971): with s = x^2 + y^2 the radius is multiplied by 1 + k1 s + k2 s^2 + k3 s^3. The rational model
(D. Claus and A. Fitzgibbon, "A rational function lens distortion model for general cameras", 2005)
divides that by 1 + k4 s + k5 s^2 + k6 s^3.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray

Real = TypeVar("Real", np.float32, np.float64)

#: Largest square of a radius on the plane at distance 1 that matters.
_FARTHEST = 1e4


def on_image_plane(points: FloatArray, distortion: FloatArray | None) -> FloatArray:
    """Project points onto the plane at distance 1 before the camera.

    Parameters
    ----------
    points
        In the camera frame, float64 (n, 3).
    distortion
        Coefficients of the lens in OpenCV's order, float64 (4,), (5,) or (8,); None: no distortion.

    Returns
    -------
    FloatArray
        x, y, float64 (n, 2): pixels before focal lengths and principal point are applied. NaN
        unless z is above 0, and beyond `largest_radius`.
    """
    z = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    plane = np.asarray(points[:, :2] / z[:, None])
    if distortion is None or not np.any(distortion):
        return plane
    # Beyond, points would fold back into the image: far ones seem to be in its middle.
    inside = np.sum(plane * plane, axis=1) < largest_radius(distortion) ** 2
    return distorted(np.where(inside[:, None], plane, np.nan), distortion)


def distorted(plane: NDArray[Real], distortion: FloatArray) -> NDArray[Real]:
    """Apply the distortion to points on the plane at distance 1.

    Parameters
    ----------
    plane
        x, y, float64 or float32 (n, 2).
    distortion
        Coefficients in OpenCV's order, float64 (4,), (5,) or (8,).

    Returns
    -------
    NDArray[Real]
        x, y of the same type, (n, 2).
    """
    # Python's numbers keep float32, and Horner's rule needs no arrays for the zeros.
    k1, k2, p1, p2, k3, k4, k5, k6 = _eight(distortion)
    x, y = plane[:, 0], plane[:, 1]
    s = x * x + y * y
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    if k4 or k5 or k6:
        radial = radial / (1.0 + s * (k4 + s * (k5 + s * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
            y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )


def largest_radius(distortion: FloatArray) -> float:
    """Find the radius up to which the distorted radius increases with the undistorted one.

    It is the first zero of the derivative of the distorted radius r N(r^2) / D(r^2), or of D, the
    polynomial of k4, k5, k6; infinite if there is none.

    Parameters
    ----------
    distortion
        Coefficients in OpenCV's order, float64 (4,), (5,) or (8,).
    """
    numerator, denominator = _radial_polynomials(distortion)
    # By s = r^2 the derivative is (N D + 2 s (N' D - N D')) / D^2.
    slope: FloatArray = np.polysub(
        np.polymul(np.polyder(numerator), denominator),
        np.polymul(numerator, np.polyder(denominator)),
    )
    turning = np.polyadd(np.polymul(numerator, denominator), np.polymul([2.0, 0.0], slope))
    roots = np.concatenate([_positive_roots(turning), _positive_roots(denominator)])
    return math.sqrt(float(roots.min())) if len(roots) else math.inf


def _radial_polynomials(distortion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator of the radial factor by s = r^2, the highest power first."""
    k1, k2, _, _, k3, k4, k5, k6 = _eight(distortion)
    return np.array([k3, k2, k1, 1.0]), np.array([k6, k5, k4, 1.0])


def _eight(distortion: FloatArray) -> tuple[float, ...]:
    return (*distortion.tolist(), *(0.0,) * 4)[:8]


def _positive_roots(polynomial: FloatArray) -> FloatArray:
    # Coefficients that change nothing within 89 degrees of the axis would overflow in a division.
    power = np.arange(len(polynomial))[::-1]
    roots = np.roots(np.where(np.abs(polynomial) * _FARTHEST**power < 1e-12, 0.0, polynomial))
    real = (np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)
    return np.asarray(roots.real[real], dtype=np.float64)
