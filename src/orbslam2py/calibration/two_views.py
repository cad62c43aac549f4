# SPDX-License-Identifier: BSD-3-Clause
"""Points in pairs of images, the motions between them, and the residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings import CameraSettings

#: Cauchy's scale: residuals well above it count little [pixels].
SCALE = 1.0
#: Least stretch of a lens.
_FOLD = 0.2


@dataclass(frozen=True)
class PointPair:
    """The same points in two images.

    Attributes
    ----------
    first, second
        Pixels in the images as they are, float64 (n, 2).
    depths
        Depths in the first image up to a common factor, 0 where unknown, (n,); None if there are
        none.
    """

    first: FloatArray
    second: FloatArray
    depths: FloatArray | None = None


@dataclass(frozen=True)
class Problem:
    """Pairs (p) of equally many points (n), filled up with ones that do not count.

    Attributes
    ----------
    first, second
        (p, n, 2), normalised by the calibration as it is.
    counts
        (p, n): 1 for a point, 0 for a filling.
    depths
        (p, n) in the first image, or None.
    focal
        Focal length by which residuals become pixels.
    """

    first: FloatArray
    second: FloatArray
    counts: FloatArray
    depths: FloatArray | None
    focal: float

    @property
    def n_pose(self) -> int:
        """Degrees of freedom of a pose: without depths the length of the motion is not known."""
        return 5 if self.depths is None else 6


@dataclass(frozen=True)
class State:
    """A solution of a `Problem`, with its residuals.

    Attributes
    ----------
    R, t
        First to second camera, (p, 3, 3) and (p, 3): a direction, or in the unit of the depths.
    changes
        Of the calibration, (4,): logarithm of the focal length's factor, principal point, radial.
    residuals
        (p, n, 1 or 2) pixels.
    cost
        Sum of their robust costs, square pixels.
    """

    R: FloatArray
    t: FloatArray
    changes: FloatArray
    residuals: FloatArray
    cost: float


def make_problem(camera: CameraSettings, pairs: list[PointPair]) -> Problem:
    """Normalise the points by the calibration, and the depths of every pair by their median."""
    shape = len(pairs), max(len(pair.first) for pair in pairs)
    first, second = np.zeros((*shape, 2)), np.zeros((*shape, 2))
    counts, depths = np.zeros(shape), np.ones(shape)
    for i, pair in enumerate(pairs):
        n = len(pair.first)
        first[i, :n] = _normalised(camera, pair.first)
        second[i, :n] = _normalised(camera, pair.second)
        counts[i, :n] = 1
        if pair.depths is not None:
            depths[i, :n] = pair.depths / np.median(pair.depths)
    has_depth = pairs[0].depths is not None
    return Problem(first, second, counts, depths if has_depth else None, camera.fx)


def _normalised(camera: CameraSettings, pixels: FloatArray) -> FloatArray:
    points = np.ascontiguousarray(pixels[:, None])
    rays = cv2.undistortPoints(points, camera.matrix, camera.distortion)
    return np.asarray(rays[:, 0], dtype=np.float64)


def begin(problem: Problem, changes: FloatArray) -> State:
    """Find poses without initial values, for a changed calibration."""
    n = len(problem.counts)
    R, t = np.repeat(np.eye(3)[None], n, axis=0), np.zeros((n, 3))
    if problem.depths is not None:
        return evaluate(problem, R, t, changes)
    t[:, 2] = 1.0
    limit = 1.5 * SCALE / (problem.focal * float(np.exp(changes[0])))
    for i, counts in enumerate(problem.counts):
        first = _changed(problem.first[i, counts > 0], changes).points
        second = _changed(problem.second[i, counts > 0], changes).points
        E, _ = cv2.findEssentialMat(first, second, np.eye(3), cv2.RANSAC, 0.999, limit)
        if E is not None and E.shape[0] >= 3:
            _, R[i], direction, _ = cv2.recoverPose(E[:3], first, second, np.eye(3))
            t[i] = direction.ravel()
    return evaluate(problem, R, t, changes)


# ---- residuals ---------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Rays:
    """Normalised points by a changed calibration, and how they stretch the ones as they were."""

    points: FloatArray
    """(p, n, 2)"""
    outwards: FloatArray
    """(p, n, 2) unit vectors from the principal point."""
    along: FloatArray
    """(p, n, 1) stretch along them ..."""
    across: FloatArray
    """... and across."""

    def slopes(self, slopes: FloatArray) -> FloatArray:
        """Slopes by the points as they were, of slopes by the changed ones, (p, n, 2)."""
        return self._scaled(slopes, self.along, self.across)

    def back(self, errors: FloatArray) -> FloatArray:
        """Small distances between changed points, as they were before, (p, n, 2)."""
        return self._scaled(errors, 1 / self.along, 1 / self.across)

    def _scaled(self, vectors: FloatArray, along: FloatArray, across: FloatArray) -> FloatArray:
        part = (vectors * self.outwards).sum(axis=-1, keepdims=True)
        return np.asarray(across * vectors + (along - across) * part * self.outwards)


def _changed(rays: FloatArray, changes: FloatArray) -> _Rays:
    scale = float(np.exp(-changes[0]))
    moved = (rays - changes[1:3]) * scale
    r2 = (moved * moved).sum(axis=-1, keepdims=True)
    bend = changes[3] * r2
    # Beyond a fold of the lens there is nothing to compare with; the limit keeps numbers finite.
    along, across = np.maximum(1 + 3 * bend, _FOLD), np.maximum(1 + bend, _FOLD)
    outwards = moved / np.sqrt(np.maximum(r2, 1e-18))
    return _Rays(moved * (1 + bend), outwards, along * scale, across * scale)


def residuals_of(problem: Problem, R: FloatArray, t: FloatArray, changes: FloatArray) -> FloatArray:
    """Residuals (..., p, n, 1 or 2) in pixels of the given images, for any changes.

    Poses (..., p, 3, 3) and (..., p, 3): many at a time take hardly longer than one.
    """
    first, second = _changed(problem.first, changes), _changed(problem.second, changes)
    if problem.depths is None:
        return np.asarray(_sampson(first, second, R, t) * problem.focal)
    rays = np.concatenate([first.points, np.ones_like(first.along)], axis=-1)
    seen = (rays * problem.depths[..., None]) @ R.swapaxes(-1, -2) + t[..., None, :]
    z = np.where(np.abs(seen[..., 2:]) < 1e-6, 1e-6, seen[..., 2:])
    errors = second.back(seen[..., :2] / z - second.points) * problem.focal
    return np.asarray(np.clip(errors, -1e4, 1e4))


def _sampson(first: _Rays, second: _Rays, R: FloatArray, t: FloatArray) -> FloatArray:
    E = _cross(t) @ R
    a = first.points @ E[..., :, :2].swapaxes(-1, -2) + E[..., None, :, 2]
    b = second.points @ E[..., :2, :] + E[..., None, 2, :]
    error = (second.points * a[..., :2]).sum(axis=-1) + a[..., 2]
    by_second, by_first = second.slopes(a[..., :2]), first.slopes(b[..., :2])
    slope = (by_second**2).sum(axis=-1) + (by_first**2).sum(axis=-1)
    return np.asarray(error / np.sqrt(np.maximum(slope, 1e-18)))[..., None]


def evaluate(problem: Problem, R: FloatArray, t: FloatArray, changes: FloatArray) -> State:
    """Compute the residuals of poses and changes."""
    residuals = residuals_of(problem, R, t, changes)
    costs = np.log1p((residuals**2).sum(axis=-1) / SCALE**2) * problem.counts
    return State(R, t, changes, residuals, float(costs.sum()) * SCALE**2)


def _cross(v: FloatArray) -> FloatArray:
    matrices = np.zeros((*v.shape, 3))
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2] = -z, y, -x
    matrices[..., 1, 0], matrices[..., 2, 0], matrices[..., 2, 1] = z, -y, x
    return matrices


def _rotations(w: FloatArray) -> FloatArray:
    angle = np.maximum(np.linalg.norm(w, axis=1), 1e-12)[:, None, None]
    W = _cross(w)
    first, second = np.sin(angle) / angle * W, (1 - np.cos(angle)) / angle**2 * (W @ W)
    return np.asarray(np.eye(3) + first + second)


def move(R: FloatArray, t: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Apply steps (p, 5 or 6): a rotation, then a turn of the direction or a shift."""
    turned = _rotations(step[:, :3]) @ R
    if step.shape[1] == 6:
        return turned, t + step[:, 3:]
    aside = np.where(np.abs(t[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(t, aside)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    direction = t + u * step[:, 3:4] + np.cross(t, u) * step[:, 4:5]
    return turned, direction / np.linalg.norm(direction, axis=1, keepdims=True)


def without_gross_errors(pair: PointPair, tolerance: float = 2.0) -> PointPair | None:
    """Keep the points that agree with a geometry of two views, for any calibration.

    Parameters
    ----------
    pair : PointPair
        The points.
    tolerance : float
        Distance from the epipolar line, pixels.

    Returns
    -------
    PointPair or None
        None if there is no such geometry. Found by RANSAC (Fischler and Bolles, 1981).
    """
    if len(pair.first) < 8:
        return None
    _, found = cv2.findFundamentalMat(
        pair.first, pair.second, cv2.FM_RANSAC, tolerance, 0.999, 2000
    )
    if found is None:
        return None
    kept = found.ravel() > 0
    depths = None if pair.depths is None else pair.depths[kept]
    return replace(pair, first=pair.first[kept], second=pair.second[kept], depths=depths)
