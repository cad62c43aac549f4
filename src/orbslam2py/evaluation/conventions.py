# SPDX-License-Identifier: BSD-3-Clause
"""Whether a trajectory fits the ground truth much better if its file has another convention.

Two conventions are often confused: the order of a quaternion (w last or first), and the direction
of a pose (camera in the world or world in the camera). Positions do not show a wrong order, and
neither do rotation angles: with w at the wrong end, a quaternion is the inverse rotation in other
axes. Motions between poses, in the frame of the moving camera, show both errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from orbslam2py._arguments import pose_of
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation.alignment import Alignment
from orbslam2py.evaluation.matching import match_poses
from orbslam2py.evaluation.metrics import Evaluation, evaluate_trajectory, require_trajectories
from orbslam2py.trajectory import MAX_DIFFERENCE, QuaternionOrder, Reading, Trajectory, align
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    poses_from,
    quaternions_from_rotations,
    rotation_angles,
    rotations_from_quaternions,
)

_FEWEST_POSES = 10
_MOST_POSES = 1000  # by which readings are judged
_LEAST_TURN = np.radians(5.0)  # of both paths; with less the conventions look the same
_LARGEST_TURN = np.radians(60.0)  # between two poses that are compared
_MUCH_BETTER = 3.0
_NO_WORSE = 1.2
_GOOD_FIT = 0.5  # difference of motions, in parts of the motions
_CLEARLY = 1.5  # by which one reading must fit better than another that is more likely


@dataclass(frozen=True, eq=False)
class OtherReading:
    """Another reading of a file, with which the estimate fits the ground truth much better.

    Attributes
    ----------
    of_truth
        Whether the file of the ground truth has the other convention; otherwise that of the
        estimate.
    quaternions
        The order of its quaternions; None: unchanged.
    inverse
        Whether its poses are those of the world in the camera; None: unchanged.
    either
        Whether the other file may have the other convention instead.
    as_read, otherwise
        The figures before and with the other reading.
    """

    of_truth: bool
    quaternions: QuaternionOrder | None
    inverse: bool | None
    either: bool
    as_read: Evaluation
    otherwise: Evaluation

    @property
    def options(self) -> str:
        """Return the change of the command line of ``orbslam2py evaluate``."""
        prefix = "--truth-" if self.of_truth else "--"
        given = [] if self.quaternions is None else [f"give {prefix}quaternions {self.quaternions}"]
        if self.inverse is not None:
            given.append(f"{'give' if self.inverse else 'leave out'} {prefix}inverse")
        return " and ".join(given).replace("and give ", "and ")

    @property
    def message(self) -> str:
        """Return a message: the other convention, the figures that show it, and the remedy."""
        whose = "the truth" if self.of_truth else "the estimate"
        looks = []
        if self.quaternions is not None:
            w = "first" if self.quaternions is QuaternionOrder.WXYZ else "last"
            looks.append(f"the quaternions of {whose} look like w {w}")
        if self.inverse is not None:
            what = "the world in the camera" if self.inverse else "the camera in the world"
            looks.append(f"the poses of {whose} look like poses of {what}")
        either = ""
        if self.either:
            either = f" (or it is {'the estimate' if self.of_truth else 'the truth'} that is so)"
        return f"{' and '.join(looks)}{either}: {self._figures()}; {self.options}"

    def _figures(self) -> str:
        pairs = (
            ("ATE", "m", self.otherwise.ate, self.as_read.ate),
            ("RPE", "m", self.otherwise.rpe_translation, self.as_read.rpe_translation),
            ("RPE", "deg", self.otherwise.rpe_rotation, self.as_read.rpe_rotation),
        )
        texts = [
            f"{name} {new.rmse:.3g} {unit} instead of {old.rmse:.3g} {unit}"
            for name, unit, new, old in pairs
            if new is not None and old is not None and new.rmse * _NO_WORSE < old.rmse
        ]
        return ", ".join(texts) or "the motions of both paths then agree"


@dataclass(frozen=True)
class _Fit:
    """Two figures of the fit of an estimate, relative to the size of the path."""

    positions: float
    motions: float

    def is_much_better_than(self, other: _Fit, *, inverted: bool) -> bool:
        if self.motions > _GOOD_FIT or self.motions * _MUCH_BETTER > other.motions:
            return False
        factor = _MUCH_BETTER if inverted else 1 / _NO_WORSE
        return self.positions * factor <= other.positions + 1e-9

    @property
    def total(self) -> float:
        return float(np.hypot(self.positions, self.motions)) + 1e-6


def find_other_reading(
    estimate: Trajectory,
    truth: Trajectory,
    alignment: Alignment | str = Alignment.AUTO,
    *,
    estimate_reading: Reading | None = None,
    truth_reading: Reading | None = None,
    T_body_camera: FloatArray | None = None,
    single_camera: bool | None = None,
    max_difference: float = MAX_DIFFERENCE,
    offset: float = 0.0,
    timed: bool = True,
) -> OtherReading | None:
    """Search another convention with which an estimate fits the ground truth much better.

    The other order of quaternions, inverse poses, and both are tried, for the estimate and for the
    ground truth. An order in the header of the file, or given by the caller, is not questioned.
    Nothing is found in paths with less than 10 matched poses or with less than 5 degrees of
    rotation.

    Parameters
    ----------
    estimate, truth, alignment, single_camera, max_difference, offset, timed
        As of `evaluate_trajectory`.
    estimate_reading, truth_reading
        The conventions of their files, from `read_trajectory_file`; by default those of TUM.
    T_body_camera
        Factor that turned true poses of the body into those of the camera, float64 (4, 4).

    Returns
    -------
    OtherReading or None
        None if the files are right, or if the data do not show it.

    Raises
    ------
    DatasetError
        As `evaluate_trajectory`.
    """
    alignment = Alignment.of(alignment)
    require_trajectories(estimate, truth)
    if T_body_camera is not None:
        T_body_camera = pose_of(T_body_camera, "T_body_camera", DatasetError)
    readings = [
        reading or Reading(QuaternionOrder.XYZW, order_is_known=False)
        for reading in (estimate_reading, truth_reading)
    ]
    tracked, true = estimate.select(~estimate.lost).shifted(offset), truth.select(~truth.lost)
    i, j = match_poses(tracked, true, max_difference)
    if len(i) < _FEWEST_POSES:
        return None
    chosen = np.linspace(0, len(i) - 1, min(len(i), _MOST_POSES)).astype(np.int64)
    pair = (tracked.T_wc[i[chosen]], true.T_wc[j[chosen]])
    with np.errstate(all="ignore"):
        best = _best_reading(pair, readings, T_body_camera)
    if best is None:
        return None
    side, swap, invert, either = best

    def read_again(trajectory: Trajectory) -> Trajectory:
        reading, extrinsics = readings[side], T_body_camera if side else None
        T_wc = _read_again(trajectory.T_wc, reading, swap=swap, invert=invert, by=extrinsics)
        return Trajectory(trajectory.timestamps, T_wc, trajectory.lost, trajectory.indices)

    def figures(first: Trajectory, second: Trajectory) -> Evaluation:
        return evaluate_trajectory(
            *(first, second, alignment),
            single_camera=single_camera,
            max_difference=max_difference,
            offset=offset,
            timed=timed,
        )

    as_read = figures(estimate, truth)
    again = (estimate, read_again(truth)) if side else (read_again(estimate), truth)
    order = readings[side].quaternions
    return OtherReading(
        of_truth=bool(side),
        quaternions=order.other if swap and order is not None else None,
        inverse=not readings[side].inverse if invert else None,
        either=either,
        as_read=as_read,
        otherwise=figures(*again),
    )


def _best_reading(
    pair: tuple[FloatArray, FloatArray], readings: list[Reading], extrinsics: FloatArray | None
) -> tuple[int, bool, bool, bool] | None:
    """Return side (0 estimate, 1 truth), whether to swap, to invert, whether either fits."""
    if not all(np.isfinite(poses).all() and _turns(poses) for poses in pair):
        return None
    lag = _lag(pair[1])
    as_read = _fit(*pair, lag)
    found = []
    for side, swap, invert in product((0, 1), (False, True), (False, True)):
        reading = readings[side]
        is_possible = reading.is_file and not (swap and reading.order_is_known)
        if not (swap or invert) or not is_possible:
            continue
        by = extrinsics if side else None
        again = list(pair)
        again[side] = _read_again(pair[side], reading, swap=swap, invert=invert, by=by)
        fit = _fit(again[0], again[1], lag)
        if fit.is_much_better_than(as_read, inverted=invert):
            unlikely = (_CLEARLY if side else 1.0) * (_CLEARLY if swap and invert else 1.0)
            found.append((fit.total * unlikely, side, swap, invert))
    if not found:
        return None
    least, *best = min(found)
    either = any(one[1] != best[0] and one[0] < _CLEARLY**2 * least for one in found)
    return int(best[0]), bool(best[1]), bool(best[2]), either


def _read_again(
    T_wc: FloatArray, reading: Reading, *, swap: bool, invert: bool, by: FloatArray | None
) -> FloatArray:
    """Return poses (n, 4, 4) of the file in another reading."""
    T = T_wc if by is None else T_wc @ inverse_poses(by)
    T = inverse_poses(T) if reading.inverse else T
    if swap:
        xyzw = quaternions_from_rotations(T[:, :3, :3])
        # Of x y z w the file's first number is x if w was taken for the last, and w else.
        other = np.roll(xyzw, -1 if reading.quaternions is QuaternionOrder.XYZW else 1, axis=1)
        T = poses_from(rotations_from_quaternions(other), T[:, :3, 3])
    T = inverse_poses(T) if invert != reading.inverse else T
    return T if by is None else T @ by


def _turns(T: FloatArray) -> bool:
    return bool(rotation_angles(T[0, :3, :3].T @ T[:, :3, :3]).max() >= _LEAST_TURN)


def _lag(T: FloatArray) -> int:
    """Return the steps between compared poses: long, but without large rotations."""
    lag = 1
    while 2 * lag <= len(T) // 4:
        turned = rotation_angles(np.swapaxes(T[: -2 * lag, :3, :3], 1, 2) @ T[2 * lag :, :3, :3])
        if np.percentile(turned, 90) > _LARGEST_TURN:
            break
        lag *= 2
    return lag


def _fit(estimate: FloatArray, truth: FloatArray, lag: int) -> _Fit:
    points, targets = estimate[:, :3, 3], truth[:, :3, 3]
    try:
        left = align(points, targets, with_scale=True).apply(points) - targets
        motions = _difference_of_motions(_motions(estimate, lag), _motions(truth, lag))
    except np.linalg.LinAlgError:
        return _Fit(np.inf, np.inf)
    spread = float(np.linalg.norm(targets - targets.mean(axis=0)))
    return _Fit(float(np.linalg.norm(left)) / max(spread, 1e-12), motions)


def _motions(T: FloatArray, lag: int) -> tuple[FloatArray, FloatArray]:
    """Return rotations (sines of the half angle) and translations, in the first pose's frame."""
    moved = inverse_poses(T[:-lag]) @ T[lag:]
    q = quaternions_from_rotations(moved[:, :3, :3])
    return q[:, :3] * np.where(q[:, 3:] < 0, -1.0, 1.0), moved[:, :3, 3]


def _difference_of_motions(
    estimate: tuple[FloatArray, FloatArray], truth: tuple[FloatArray, FloatArray]
) -> float:
    """Return relative differences of motions, up to a fixed rotation and a scale."""
    sizes = [max(_size(a), _size(b), 1e-12) for a, b in zip(estimate, truth, strict=True)]
    turns = estimate[0] / sizes[0], truth[0] / sizes[0]
    shifts = estimate[1] / max(_size(estimate[1]), 1e-12), truth[1] / max(_size(truth[1]), 1e-12)
    a, b = np.concatenate([turns[0], shifts[0]]), np.concatenate([turns[1], shifts[1]])
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return _size(a @ R.T - b)


def _size(vectors: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
