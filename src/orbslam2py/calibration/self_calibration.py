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
from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.two_views import (
    SCALE,
    PointPair,
    Problem,
    State,
    begin,
    evaluate,
    make_problem,
    move,
    residuals_of,
)
from orbslam2py.settings import CameraSettings

#: Places of the changes in a vector of all: logarithm of the focal length's factor, principal
#: point (by the focal length), radial distortion.
FOCAL, CENTRE, RADIAL = (0,), (1, 2), (3,)
_N_CHANGES = 4

#: Factors of the focal length that are tried first are exp of these.
_TRIED = (0.25, 0.5, 0.75)
#: The one for which poses are found anew.
_ANEW = 0.5
_STEP = 1e-6
_HALVED = 6


@dataclass(frozen=True)
class Change:
    """A change of the calibration, and how much better it explains the points.

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
class CalibrationGains:
    """How much better changed calibrations explain the points; see `Change`.

    Attributes
    ----------
    residual
        Root of the mean robust cost with the calibration as it is, pixels.
    n_pairs, n_points
        Numbers of pairs and points used.
    focal, centre, radial
        The best change of only the focal length, the principal point, the distortion.
    """

    residual: float
    n_pairs: int
    n_points: int
    focal: Change
    centre: Change
    radial: Change


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
        None if no pair was left, and for a fisheye camera, which is not judged.
    """
    if camera.is_fisheye:
        return None
    kept = [pair for pair in map(_with_depth, pairs) if len(pair.first) >= least]
    if not kept:
        return None
    problem = make_problem(camera, kept)
    start = begin(problem, np.zeros(_N_CHANGES))
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
    known = np.isfinite(pair.depths) & (pair.depths > 0)
    return PointPair(pair.first[known], pair.second[known], pair.depths[known])


# ---- the solver --------------------------------------------------------------------------------
def _slopes(problem: Problem, state: State, free: tuple[int, ...]) -> FloatArray:
    """Derivatives of the residuals (p, n, m, pose and free changes), by differences."""
    k_pose, n_pairs = problem.n_pose, len(state.R)
    steps = np.repeat(_STEP * np.eye(k_pose), n_pairs, axis=0)
    R, t = move(np.tile(state.R, (k_pose, 1, 1)), np.tile(state.t, (k_pose, 1)), steps)
    shape = k_pose, n_pairs
    columns = list(
        residuals_of(problem, R.reshape(*shape, 3, 3), t.reshape(*shape, 3), state.changes)
    )
    for k in free:
        changes = state.changes.copy()
        changes[k] += _STEP
        columns.append(residuals_of(problem, state.R, state.t, changes))
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


def _normal(problem: Problem, state: State, free: tuple[int, ...]) -> _Normal:
    J = _slopes(problem, state, free)
    squared = (state.residuals**2).sum(axis=-1)
    weights = problem.counts / (1 + squared / SCALE**2)
    p, n = len(J), J.shape[-1]
    weighted = (J * weights[..., None, None]).reshape(p, -1, n)
    H = weighted.transpose(0, 2, 1) @ J.reshape(p, -1, n)
    slope = (weighted * state.residuals.reshape(p, -1, 1)).sum(axis=1)
    k = problem.n_pose
    return _Normal(H[:, :k, :k], H[:, :k, k:], H[:, k:, k:], slope[:, :k], slope[:, k:])


def _solve(problem: Problem, state: State, free: tuple[int, ...], iterations: int) -> State:
    damping = 1e-3
    for _ in range(iterations):
        normal = _normal(problem, state, free)
        for _ in range(_HALVED):
            poses, step = normal.step(damping)
            changes = state.changes.copy()
            changes[list(free)] += step
            better = evaluate(problem, *move(state.R, state.t, poses), changes)
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


def _tried(problem: Problem, start: State) -> Iterable[State]:
    """Solutions of a range of focal lengths, each begun at that of its neighbour."""
    yield start
    for sign in (1, -1):
        state = start
        for value in _TRIED:
            changes = start.changes.copy()
            changes[0] = sign * value
            near = evaluate(problem, state.R, state.t, changes)
            # Poses of a far too long or short focal length may lead nowhere.
            anew = [begin(problem, changes)] if value == _ANEW else []
            state = min((_solve(problem, one, (), 4) for one in (near, *anew)), key=_cost)
            yield state


def _cost(state: State) -> float:
    return state.cost


def _change(problem: Problem, before: State, start: State, free: tuple[int, ...]) -> Change:
    state = _solve(problem, start, free, 12)
    _, S, _ = _normal(problem, state, free).reduced(0.0)
    variance = state.cost / float(problem.counts.sum())
    covariance = np.linalg.inv(S + 1e-9 * np.eye(len(free))) * variance
    return Change(
        values=state.changes[list(free)],
        deviations=np.sqrt(np.diag(covariance)),
        gain=before.cost / max(state.cost, 1e-12),
    )
