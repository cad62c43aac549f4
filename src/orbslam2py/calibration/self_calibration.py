# SPDX-License-Identifier: BSD-3-Clause
"""Whether another focal length, principal point or distortion explains tracked points better.

Points that were followed through a few images obey the geometry of a moving camera. With the right
calibration no other one does clearly better; with a wrong one another does, if the camera has
turned enough to tell: a camera that only moves along cannot know its focal length (Sturm, Critical
motion sequences for monocular self-calibration, CVPR 1997). So the poses of some pairs of images
are found together with one common change of the calibration, by Levenberg's and Marquardt's method
with Cauchy's robust costs (Hartley and Zisserman, Multiple View Geometry, appendix 6), and the cost
is compared with that of the calibration as it is. What is left of a pair is the distance from the
epipolar lines (Sampson's approximation, section 11.4), or, where the depths of the first image's
points are known up to a common factor, the distance from where they reappear.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings import CameraSettings

#: Places of the changes in a vector of all: logarithm of the focal length's factor, principal
#: point (by the focal length), radial distortion.
FOCAL, CENTRE, RADIAL = (0,), (1, 2), (3,)
_N_CHANGES = 4

#: Cauchy's scale: residuals well above it count little [pixels].
_SCALE = 1.0
#: Factors of the focal length that are tried first are exp of these.
_TRIED = (0.25, 0.5, 0.75)
#: The one for which poses are found anew.
_ANEW = 0.5
_STEP = 1e-6
#: Least stretch of a lens.
_FOLD = 0.2
_HALVED = 6


@dataclass(frozen=True)
class Change:
    """What a changed calibration explains better.

    Attributes
    ----------
    values
        Change of each parameter: log of the factor of fx and fy; shift of the principal point by
        the focal length, x and y; first radial coefficient.
    deviations
        Their standard deviations, from what is left unexplained.
    gain
        Robust cost of the calibration as it is by that of the changed one, at least 1.
    """

    values: FloatArray
    deviations: FloatArray
    gain: float

    @property
    def significance(self) -> float:
        """Largest change in standard deviations."""
        return float(np.max(np.abs(self.values) / self.deviations))


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
class CalibrationGains:
    """How much better changed calibrations explain the points; see `Change`.

    Attributes
    ----------
    residual
        Root of the mean robust cost with the calibration as it is, pixels.
    n_pairs, n_points
        What was looked at.
    focal, centre, radial
        The best change of only the focal length, the principal point, the distortion.
    """

    residual: float
    n_pairs: int
    n_points: int
    focal: Change
    centre: Change
    radial: Change


@dataclass(frozen=True)
class _Problem:
    """Pairs (p) of equally many points (n), filled up with ones that do not count."""

    first: FloatArray
    """(p, n, 2) normalised by the calibration."""
    second: FloatArray
    counts: FloatArray
    """(p, n) 1 for a point, 0 for a filling."""
    depths: FloatArray | None
    focal: float

    @property
    def n_pose(self) -> int:
        return 5 if self.depths is None else 6


@dataclass(frozen=True)
class _State:
    R: FloatArray
    """(p, 3, 3) first to second camera."""
    t: FloatArray
    """(p, 3): a direction, or in the unit of the depths."""
    changes: FloatArray
    """(4,)"""
    residuals: FloatArray
    """(p, n, m) pixels"""
    cost: float


def calibration_gains(
    camera: CameraSettings, pairs: Iterable[PointPair], *, least: int = 60
) -> CalibrationGains | None:
    """Find out how much better other calibrations explain points of some pairs of images.

    Parameters
    ----------
    camera : CameraSettings
        The calibration in question, of the images as they are.
    pairs : iterable of PointPair
        Points without gross errors; all with depths or all without.
    least : int
        Pairs with fewer points (with depth, if there are depths) are left out.

    Returns
    -------
    CalibrationGains or None
        None if no pair was left.
    """
    kept = [pair for pair in map(_with_depth, pairs) if len(pair.first) >= least]
    if not kept:
        return None
    problem = _make_problem(camera, kept)
    start = _begin(problem, np.zeros(_N_CHANGES))
    start = _solve(problem, start, (), 15)
    count = float(problem.counts.sum())
    near = min(_tried(problem, start), key=_cost)
    return CalibrationGains(
        residual=float(np.sqrt(start.cost / count)),
        n_pairs=len(kept),
        n_points=int(count),
        focal=_change(problem, start, near, FOCAL),
        centre=_change(problem, start, start, CENTRE),
        radial=_change(problem, start, start, RADIAL),
    )


def _with_depth(pair: PointPair) -> PointPair:
    if pair.depths is None:
        return pair
    known = pair.depths > 0
    return PointPair(pair.first[known], pair.second[known], pair.depths[known])


def _make_problem(camera: CameraSettings, pairs: list[PointPair]) -> _Problem:
    shape = len(pairs), max(len(pair.first) for pair in pairs)
    first, second = np.zeros((*shape, 2)), np.zeros((*shape, 2))
    counts, depths = np.zeros(shape), np.ones(shape)
    for i, pair in enumerate(pairs):
        n = len(pair.first)
        first[i, :n], second[i, :n] = (
            _normalised(camera, pair.first),
            _normalised(camera, pair.second),
        )
        counts[i, :n] = 1
        if pair.depths is not None:
            depths[i, :n] = pair.depths / np.median(pair.depths)
    has_depth = pairs[0].depths is not None
    return _Problem(first, second, counts, depths if has_depth else None, camera.fx)


def _normalised(camera: CameraSettings, pixels: FloatArray) -> FloatArray:
    points = np.ascontiguousarray(pixels[:, None])
    rays = cv2.undistortPoints(points, camera.matrix, camera.distortion)
    return np.asarray(rays[:, 0], dtype=np.float64)


def _begin(problem: _Problem, changes: FloatArray) -> _State:
    """Find poses without knowing any, for a changed calibration."""
    n = len(problem.counts)
    R, t = np.repeat(np.eye(3)[None], n, axis=0), np.zeros((n, 3))
    if problem.depths is not None:
        return _evaluate(problem, R, t, changes)
    t[:, 2] = 1.0
    limit = 1.5 * _SCALE / (problem.focal * float(np.exp(changes[0])))
    for i, counts in enumerate(problem.counts):
        first = _changed(problem.first[i, counts > 0], changes).points
        second = _changed(problem.second[i, counts > 0], changes).points
        E, _ = cv2.findEssentialMat(first, second, np.eye(3), cv2.RANSAC, 0.999, limit)
        if E is not None and E.shape[0] >= 3:
            _, R[i], direction, _ = cv2.recoverPose(E[:3], first, second, np.eye(3))
            t[i] = direction.ravel()
    return _evaluate(problem, R, t, changes)


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


def _residuals(problem: _Problem, R: FloatArray, t: FloatArray, changes: FloatArray) -> FloatArray:
    """Residuals (p, n, 1 or 2) in pixels of the images as they are, whatever the changes."""
    first, second = _changed(problem.first, changes), _changed(problem.second, changes)
    if problem.depths is None:
        return np.asarray(_sampson(first, second, R, t) * problem.focal)
    rays = np.concatenate([first.points, np.ones_like(first.along)], axis=-1)
    seen = (rays * problem.depths[..., None]) @ R.transpose(0, 2, 1) + t[:, None]
    z = np.where(np.abs(seen[..., 2:]) < 1e-6, 1e-6, seen[..., 2:])
    errors = second.back(seen[..., :2] / z - second.points) * problem.focal
    return np.asarray(np.clip(errors, -1e4, 1e4))


def _sampson(first: _Rays, second: _Rays, R: FloatArray, t: FloatArray) -> FloatArray:
    E = _cross(t) @ R
    a = first.points @ E[:, :, :2].transpose(0, 2, 1) + E[:, None, :, 2]
    b = second.points @ E[:, :2, :] + E[:, None, 2, :]
    error = (second.points * a[..., :2]).sum(axis=-1) + a[..., 2]
    by_second, by_first = second.slopes(a[..., :2]), first.slopes(b[..., :2])
    slope = (by_second**2).sum(axis=-1) + (by_first**2).sum(axis=-1)
    return np.asarray(error / np.sqrt(np.maximum(slope, 1e-18)))[..., None]


def _evaluate(problem: _Problem, R: FloatArray, t: FloatArray, changes: FloatArray) -> _State:
    residuals = _residuals(problem, R, t, changes)
    costs = np.log1p((residuals**2).sum(axis=-1) / _SCALE**2) * problem.counts
    return _State(R, t, changes, residuals, float(costs.sum()) * _SCALE**2)


def _cross(v: FloatArray) -> FloatArray:
    zero = np.zeros(len(v))
    rows = [[zero, -v[:, 2], v[:, 1]], [v[:, 2], zero, -v[:, 0]], [-v[:, 1], v[:, 0], zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _rotations(w: FloatArray) -> FloatArray:
    angle = np.maximum(np.linalg.norm(w, axis=1), 1e-12)[:, None, None]
    W = _cross(w)
    first, second = np.sin(angle) / angle * W, (1 - np.cos(angle)) / angle**2 * (W @ W)
    return np.asarray(np.eye(3) + first + second)


def _moved(R: FloatArray, t: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Apply steps (p, 5 or 6): a rotation, then a turn of the direction or a shift."""
    turned = _rotations(step[:, :3]) @ R
    if step.shape[1] == 6:
        return turned, t + step[:, 3:]
    aside = np.where(np.abs(t[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(t, aside)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    direction = t + u * step[:, 3:4] + np.cross(t, u) * step[:, 4:5]
    return turned, direction / np.linalg.norm(direction, axis=1, keepdims=True)


# ---- the solver --------------------------------------------------------------------------------
def _slopes(problem: _Problem, state: _State, free: tuple[int, ...]) -> FloatArray:
    """Derivatives of the residuals (p, n, m, pose and free changes), by differences."""
    columns = []
    for k in range(problem.n_pose):
        step = np.zeros((len(state.R), problem.n_pose))
        step[:, k] = _STEP
        columns.append(_residuals(problem, *_moved(state.R, state.t, step), state.changes))
    for k in free:
        changes = state.changes.copy()
        changes[k] += _STEP
        columns.append(_residuals(problem, state.R, state.t, changes))
    return np.stack([(column - state.residuals) / _STEP for column in columns], axis=-1)


@dataclass(frozen=True)
class _Normal:
    """Normal equations: each pair's pose, the changes, and both; poses are eliminated."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    pose_slope: FloatArray
    change_slope: FloatArray

    def reduced(self, damping: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Damped inverse of A (p, k, k), matrix and right side of the changes alone."""
        k = self.A.shape[-1]
        A = self.A + damping * self.A * np.eye(k) + 1e-9 * np.eye(k)
        inverse: FloatArray = np.linalg.inv(A).astype(np.float64)
        BtA = self.B.transpose(0, 2, 1) @ inverse
        S = (self.C - BtA @ self.B).sum(axis=0)
        right = (self.change_slope - (BtA @ self.pose_slope[..., None])[..., 0]).sum(axis=0)
        return inverse, S, right

    def step(self, damping: float) -> tuple[FloatArray, FloatArray]:
        inverse, S, right = self.reduced(damping)
        n = len(S)
        damped = S + damping * S * np.eye(n) + 1e-9 * np.eye(n)
        changes = -np.linalg.solve(damped, right) if n else np.zeros(0)
        pull = self.pose_slope + self.B @ changes
        poses = -(inverse @ pull[..., None])[..., 0]
        return np.clip(poses, -0.5, 0.5), np.clip(changes, -0.3, 0.3)


def _normal(problem: _Problem, state: _State, free: tuple[int, ...]) -> _Normal:
    J = _slopes(problem, state, free)
    squared = (state.residuals**2).sum(axis=-1)
    weights = problem.counts / (1 + squared / _SCALE**2)
    p, n = len(J), J.shape[-1]
    weighted = (J * weights[..., None, None]).reshape(p, -1, n)
    H = weighted.transpose(0, 2, 1) @ J.reshape(p, -1, n)
    slope = (weighted * state.residuals.reshape(p, -1, 1)).sum(axis=1)
    k = problem.n_pose
    return _Normal(H[:, :k, :k], H[:, :k, k:], H[:, k:, k:], slope[:, :k], slope[:, k:])


def _solve(problem: _Problem, state: _State, free: tuple[int, ...], iterations: int) -> _State:
    damping = 1e-3
    for _ in range(iterations):
        normal = _normal(problem, state, free)
        for _ in range(_HALVED):
            poses, step = normal.step(damping)
            changes = state.changes.copy()
            changes[list(free)] += step
            better = _evaluate(problem, *_moved(state.R, state.t, poses), changes)
            if better.cost < state.cost:
                break
            damping *= 8
        else:
            return state
        done = state.cost - better.cost < 1e-5 * state.cost
        state, damping = better, max(damping / 5, 1e-8)
        if done:
            return state
    return state


def _tried(problem: _Problem, start: _State) -> Iterable[_State]:
    """Solutions of a range of focal lengths, each begun at that of its neighbour."""
    yield start
    for sign in (1, -1):
        state = start
        for value in _TRIED:
            changes = start.changes.copy()
            changes[0] = sign * value
            near = _evaluate(problem, state.R, state.t, changes)
            # Poses of a far too long or short focal length may lead nowhere.
            anew = [_begin(problem, changes)] if value == _ANEW else []
            state = min((_solve(problem, one, (), 4) for one in (near, *anew)), key=_cost)
            yield state


def _cost(state: _State) -> float:
    return state.cost


def _change(problem: _Problem, before: _State, start: _State, free: tuple[int, ...]) -> Change:
    state = _solve(problem, start, free, 12)
    _, S, _ = _normal(problem, state, free).reduced(0.0)
    variance = state.cost / float(problem.counts.sum())
    covariance = np.linalg.inv(S + 1e-9 * np.eye(len(free))) * variance
    return Change(
        values=state.changes[list(free)],
        deviations=np.sqrt(np.diag(covariance)),
        gain=before.cost / max(state.cost, 1e-12),
    )


def without_gross_errors(pair: PointPair, tolerance: float = 2.0) -> PointPair | None:
    """Keep the points that agree with some geometry of two views, whatever the calibration.

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
