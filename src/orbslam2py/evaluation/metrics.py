# SPDX-License-Identifier: BSD-3-Clause
"""How far an estimated trajectory is from the true one.

Absolute trajectory error and relative pose error as Sturm et al. (IROS 2012) define them, errors
over path segments as the KITTI odometry benchmark does (Geiger et al., CVPR 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.evaluation.alignment import Alignment, Similarity, align, match_poses
from orbslam2py.trajectory import MAX_DIFFERENCE, Trajectory
from orbslam2py.trajectory.rotations import inverse_poses, rotation_angles

#: Lengths of KITTI's path segments [m].
SEGMENT_LENGTHS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
_SEGMENT_STEP = 10  # frames between the starts of segments
_SECOND_TOLERANCE = 0.1  # how far "one second later" may be off [s]


@dataclass(frozen=True)
class ErrorStatistics:
    """Figures over many errors of one kind, in the unit of the errors.

    Attributes
    ----------
    rmse
        Root of the mean square.
    mean, median, max
        Of the errors.
    """

    rmse: float
    mean: float
    median: float
    max: float

    @classmethod
    def of(cls, errors: FloatArray) -> ErrorStatistics:
        """Take the figures of errors, float64 (n,), n > 0."""
        return cls(
            rmse=float(np.sqrt(np.mean(errors**2))),
            mean=float(np.mean(errors)),
            median=float(np.median(errors)),
            max=float(np.max(errors)),
        )


@dataclass(frozen=True)
class Evaluation:
    """An estimate compared with the truth.

    Attributes
    ----------
    matched_poses
        Poses of the estimate that have a true pose at their time.
    alignment
        How they were aligned.
    transform
        From the estimate's world to the true one.
    ate
        Distance of aligned and true positions [m].
    rpe_translation, rpe_rotation
        Error of the motion from one matched pose to the next [m], [deg]; None for a single pose.
    rpe_translation_1s, rpe_rotation_1s
        The same over one second; None if the sequence is shorter or has no time stamps.
    t_rel_percent, r_rel_deg_per_100m
        KITTI's mean errors over segments of 100 to 800 m; None for shorter paths.
    """

    matched_poses: int
    alignment: Alignment
    transform: Similarity
    ate: ErrorStatistics
    rpe_translation: ErrorStatistics | None
    rpe_rotation: ErrorStatistics | None
    rpe_translation_1s: ErrorStatistics | None
    rpe_rotation_1s: ErrorStatistics | None
    t_rel_percent: float | None
    r_rel_deg_per_100m: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the figures under the names that reports use; None where there is none."""
        return {
            "matched_poses": self.matched_poses,
            "ate_alignment": str(self.alignment),
            "ate_scale": self.transform.scale,
            "ate_rmse_m": self.ate.rmse,
            "ate_mean_m": self.ate.mean,
            "ate_median_m": self.ate.median,
            "ate_max_m": self.ate.max,
            "rpe_translation_rmse_m": _rmse(self.rpe_translation),
            "rpe_rotation_rmse_deg": _rmse(self.rpe_rotation),
            "rpe_translation_rmse_m_1s": _rmse(self.rpe_translation_1s),
            "rpe_rotation_rmse_deg_1s": _rmse(self.rpe_rotation_1s),
            "t_rel_percent": self.t_rel_percent,
            "r_rel_deg_per_100m": self.r_rel_deg_per_100m,
        }


def evaluate_trajectory(
    estimate: Trajectory,
    truth: Trajectory,
    alignment: Alignment = Alignment.SE3,
    *,
    max_difference: float = MAX_DIFFERENCE,
    timed: bool = True,
) -> Evaluation:
    """Compare an estimate with the truth.

    Parameters
    ----------
    estimate
        Lost poses are left out.
    truth
        True poses of the same camera in any world.
    alignment
        ``se3`` for metric estimates, ``sim3`` for those of one camera, ``none`` if both share one
        world. With ``sim3`` the relative errors are those of the scaled estimate.
    max_difference
        Poses belong together if their time stamps differ by less [s].
    timed
        False if the time stamps are only frame numbers: no figures over one second then.

    Returns
    -------
    Evaluation
        Positions in metres if the truth is.

    Raises
    ------
    DatasetError
        If no time stamps match.
    """
    estimate = estimate.select(~estimate.lost)
    truth = truth.select(~truth.lost)
    i, j = match_poses(estimate, truth, max_difference)
    transform = Similarity.identity()
    if alignment is not Alignment.NONE:
        transform = align(
            estimate.positions[i], truth.positions[j], with_scale=alignment is Alignment.SIM3
        )
    times = estimate.timestamps[i]
    aligned, true = transform.apply_to_poses(estimate.T_wc[i]), truth.T_wc[j]
    next_pose = (np.arange(len(i) - 1), np.arange(1, len(i)))
    translation, rotation = _relative_statistics(aligned, true, next_pose)
    after_second = one_second_pairs(times) if timed else (next_pose[0][:0], next_pose[1][:0])
    translation_1s, rotation_1s = _relative_statistics(aligned, true, after_second)
    segments = segment_errors(aligned, true)
    return Evaluation(
        matched_poses=len(i),
        alignment=alignment,
        transform=transform,
        ate=ErrorStatistics.of(np.linalg.norm(aligned[:, :3, 3] - true[:, :3, 3], axis=1)),
        rpe_translation=translation,
        rpe_rotation=rotation,
        rpe_translation_1s=translation_1s,
        rpe_rotation_1s=rotation_1s,
        t_rel_percent=float(segments[:, 0].mean() * 100) if len(segments) else None,
        r_rel_deg_per_100m=float(np.degrees(segments[:, 1].mean()) * 100)
        if len(segments)
        else None,
    )


def relative_errors(
    estimate: FloatArray, truth: FloatArray, pairs: tuple[IntArray, IntArray]
) -> tuple[FloatArray, FloatArray]:
    """Take the errors of motions between pairs of poses.

    Parameters
    ----------
    estimate, truth
        Poses ``T_wc`` (n, 4, 4) of the same moments.
    pairs
        Indices of the first and the second pose of each motion, (k,) each.

    Returns
    -------
    translations, rotations
        Size of the difference of estimated and true motion, (k,) [m] and (k,) [rad].
    """
    first, second = pairs
    moved = inverse_poses(estimate[first]) @ estimate[second]
    true_moved = inverse_poses(truth[first]) @ truth[second]
    error = inverse_poses(true_moved) @ moved
    return np.linalg.norm(error[:, :3, 3], axis=1), rotation_angles(error[:, :3, :3])


def one_second_pairs(times: FloatArray) -> tuple[IntArray, IntArray]:
    """Pair every pose with the one nearest to a second later, if there is one within 0.1 s.

    Parameters
    ----------
    times
        Seconds in increasing order, (n,).

    Returns
    -------
    first, second
        Indices into `times`, int64 (k,) each.
    """
    if not len(times):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    wanted = times + 1.0
    after = np.clip(np.searchsorted(times, wanted), 0, len(times) - 1)
    before = np.clip(after - 1, 0, None)
    nearer = np.where(
        np.abs(times[before] - wanted) <= np.abs(times[after] - wanted), before, after
    )
    first = np.flatnonzero(np.abs(times[nearer] - wanted) <= _SECOND_TOLERANCE)
    return first.astype(np.int64), nearer[first].astype(np.int64)


def segment_errors(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """Take KITTI's errors over path segments of 100 to 800 m.

    Segments start at every tenth pose and end at the first pose more than their length further
    along the true path.

    Parameters
    ----------
    estimate, truth
        Poses ``T_wc`` (n, 4, 4) of the same moments.

    Returns
    -------
    FloatArray
        (k, 2): translation error per metre of length, and rotation error [rad] per metre.
    """
    steps = np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    starts = np.arange(0, len(truth), _SEGMENT_STEP)
    errors = []
    for length in SEGMENT_LENGTHS:
        ends = np.searchsorted(along, along[starts] + length, side="right")
        inside = ends < len(truth)
        translation, rotation = relative_errors(estimate, truth, (starts[inside], ends[inside]))
        errors.append(np.stack([translation / length, rotation / length], axis=1))
    return np.concatenate(errors)


def _relative_statistics(
    estimate: FloatArray, truth: FloatArray, pairs: tuple[IntArray, IntArray]
) -> tuple[ErrorStatistics | None, ErrorStatistics | None]:
    if not len(pairs[0]):
        return None, None
    translations, rotations = relative_errors(estimate, truth, pairs)
    return ErrorStatistics.of(translations), ErrorStatistics.of(np.degrees(rotations))


def _rmse(statistics: ErrorStatistics | None) -> float | None:
    return None if statistics is None else statistics.rmse
