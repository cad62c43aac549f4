# SPDX-License-Identifier: BSD-3-Clause
"""How well two views determine the direction in which the camera moved.

The covariance of the motion's five parameters is that of a robust fit of the epipolar constraint:
first-order distances (P. D. Sampson, 1982), Huber's weights, and the sandwich estimator with the
cells of an image as clusters (K.-Y. Liang and S. L. Zeger, 1986): neighbouring matches share their
errors, by what moves in the scene or by a lens that is not as stated.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.front_end import intrinsics
from orbslam2py.slam.initialization.initial_views import View
from orbslam2py.slam.initialization.third_view import Motion, placed_matches

_UNKNOWNS = 5
_HUBER = math.sqrt(3.841)  # 95 % of a residual with one degree of freedom
#: Cells along the wider side of the image.
_CELLS = 8
_STEP = 1e-5  # rad, of the central differences

Pixels = npt.NDArray[np.float32]


def direction_deviation(view: View, last: core.Frame, motion: Motion) -> float:
    """Return the standard deviation of the direction of motion between two views.

    Parameters
    ----------
    view : View
        The first view, with its matches in the last frame.
    last : orbslam2py._core.Frame
        The second view.
    motion : Motion
        From the first view to the second, with the points that it places.

    Returns
    -------
    float
        Degrees, both directions across the motion together; infinite with too few matches.
    """
    partners = placed_matches(view, motion)
    placed = np.flatnonzero(partners >= 0)
    if len(placed) <= _UNKNOWNS:
        return math.inf
    seen = partners[placed]
    fx, fy, cx, cy = intrinsics(last.camera)
    first_rays = _rays(view.frame.keypoints[placed], fx, fy, cx, cy)
    last_rays = _rays(last.keypoints[seen], fx, fy, cx, cy)
    deviations = np.sqrt((view.frame.sigma2[placed] + last.sigma2[seen]) / 2) / fx

    T_21 = motion.T_21

    def residuals(step: FloatArray) -> FloatArray:
        distances: FloatArray = _sampson(_moved(T_21, step), first_rays, last_rays) / deviations
        return distances

    at = residuals(np.zeros(_UNKNOWNS))
    steps = _STEP * np.eye(_UNKNOWNS)
    jacobian = np.stack([(residuals(s) - residuals(-s)) / (2 * _STEP) for s in steps], axis=1)
    weights = np.minimum(1.0, _HUBER / np.maximum(np.abs(at), 1e-12))
    information = (jacobian * weights[:, None]).T @ jacobian
    covariance = np.linalg.pinv(information)
    robust = covariance @ _scatter(jacobian, weights * at, last.keypoints[seen], last) @ covariance
    variance = max(np.trace(covariance[3:, 3:]), np.trace(robust[3:, 3:]))
    return math.degrees(math.sqrt(variance))


def _rays(pixels: Pixels, fx: float, fy: float, cx: float, cy: float) -> FloatArray:
    """Points (n, 3) on the plane at depth 1."""
    flat = (pixels.astype(np.float64) - (cx, cy)) / (fx, fy)
    return np.column_stack([flat, np.ones(len(flat))])


def _moved(T_21: core.Pose, step: FloatArray) -> FloatArray:
    """Return the essential matrix (3, 3) after a small turn, and a small turn of the direction."""
    turned = core.Pose.exp(np.concatenate([step[:3], np.zeros(3)])) @ T_21
    direction = T_21.translation / np.linalg.norm(T_21.translation)
    across = np.linalg.svd(direction[None])[2][1:]
    t = direction + step[3:] @ across
    x, y, z = t / np.linalg.norm(t)
    E: FloatArray = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ turned.matrix[:3, :3]
    return E


def _sampson(E: FloatArray, first_rays: FloatArray, last_rays: FloatArray) -> FloatArray:
    lines_in_last = first_rays @ E.T
    lines_in_first = last_rays @ E
    squares = np.sum(lines_in_last[:, :2] ** 2 + lines_in_first[:, :2] ** 2, axis=1)
    distances: FloatArray = np.sum(last_rays * lines_in_last, axis=1) / np.sqrt(squares)
    return distances


def _scatter(
    jacobian: FloatArray, errors: FloatArray, pixels: Pixels, last: core.Frame
) -> FloatArray:
    """Sum of outer products of the clusters' gradients, (5, 5), for few clusters corrected."""
    bounds = last.camera.bounds
    size = max(bounds.max_x - bounds.min_x, bounds.max_y - bounds.min_y) / _CELLS
    cells = np.floor(pixels / size).astype(np.int64) @ (1, 1 << 16)
    _, numbers = np.unique(cells, return_inverse=True)
    gradients = np.zeros((numbers.max() + 1, _UNKNOWNS))
    np.add.at(gradients, numbers, jacobian * errors[:, None])
    n = len(gradients)
    scatter: FloatArray = gradients.T @ gradients * (n / max(1, n - _UNKNOWNS))
    return scatter
