# SPDX-License-Identifier: BSD-3-Clause
"""From points to the image plane, through the lens.

The distortion is OpenCV's radial-tangential model (D. C. Brown, "Close-range camera calibration",
1971): with s = x^2 + y^2 the radius is multiplied by 1 + k1 s + k2 s^2 + k3 s^3.
"""

from __future__ import annotations

import math

import numpy as np

from orbslam2py._arrays import FloatArray

#: k1, k2, p1, p2, k3.
Coefficients = tuple[float, float, float, float, float]


def on_image_plane(points: FloatArray, coefficients: Coefficients | None) -> FloatArray:
    """Project points onto the plane at distance 1 before the camera.

    Parameters
    ----------
    points
        In the camera frame, float64 (n, 3).
    coefficients
        k1, k2, p1, p2, k3 of the lens; None leaves the lens out.

    Returns
    -------
    FloatArray
        x, y, float64 (n, 2): pixels but for focal lengths and principal point. NaN where z is not
        above 0, and beyond `largest_radius`.
    """
    z = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    plane = np.asarray(points[:, :2] / z[:, None])
    if coefficients is None or not any(coefficients):
        return plane
    k1, k2, p1, p2, k3 = coefficients
    x, y = plane[:, 0], plane[:, 1]
    s = x * x + y * y
    # Beyond, points would fold back into the image: far ones seem to be in its middle.
    s = np.where(s < largest_radius(coefficients) ** 2, s, np.nan)
    radial = 1 + s * (k1 + s * (k2 + s * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
            y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )


def largest_radius(coefficients: Coefficients) -> float:
    """Find the radius up to which a lens draws what is farther aside farther outside.

    It is where the derivative of r (1 + k1 r^2 + k2 r^4 + k3 r^6) first becomes 0; infinite if it
    never does.
    """
    k1, k2, _, _, k3 = coefficients
    roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    turning = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return math.sqrt(float(turning.min())) if len(turning) else math.inf
