# SPDX-License-Identifier: BSD-3-Clause
"""Errors of an estimated trajectory against the true one.

Absolute trajectory error and relative pose error as Sturm et al. (IROS 2012) define them, errors
over path segments as the KITTI odometry benchmark does (Geiger et al., CVPR 2012).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from orbslam2py._arguments import finite_number, shown
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation.alignment import Alignment, differ_in_unit
from orbslam2py.evaluation.matching import Matched, describe_match, match_poses
from orbslam2py.trajectory import (
    MAX_DIFFERENCE,
    Similarity,
    Trajectory,
    align,
    align_yaw,
    lengths_along,
)
from orbslam2py.trajectory.rotations import inverse_poses, require_poses, rotation_angles

#: Lengths of KITTI's path segments [m].
SEGMENT_LENGTHS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
_SEGMENT_STEP = 10  # frames between the starts of segments
_SECOND_TOLERANCE = 0.1  # how far "one second later" may be off [s]

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class ErrorStatistics:
    """Statistics of errors of one kind, in the unit of the errors.

    Attributes
    ----------
    rmse
        Root of the mean square.
    mean, median, max
        Unit of the errors.
    """

    rmse: float
    mean: float
    median: float
    max: float

    @classmethod
    def of(cls, errors: FloatArray) -> ErrorStatistics | None:
        """Compute the statistics of errors (n,); None if there are none, or not all finite."""
        if not len(errors) or not np.isfinite(errors).all():
            return None
        return cls(
            rmse=float(np.sqrt(np.mean(errors**2))),
            mean=float(np.mean(errors)),
            median=float(np.median(errors)),
            max=float(np.max(errors)),
        )


@dataclass(frozen=True)
class Evaluation:
    """An estimate compared with the truth; each figure is None where it cannot be computed.

    Attributes
    ----------
    matched
        The compared poses.
    alignment
        The alignment that was used; never ``auto``.
    transform
        From the estimate's world to the true one.
    single_camera
        Whether the estimate is of a single camera without depth; None if it is not known.
    unit_factor
        Factor on lengths, if their unit differs from that of the ground truth, as with a single
        camera; None if it does not differ, or is not known.
    ate
        Distance of aligned and true positions [m]; None for a single pose, and with ``sim3`` for
        two, because any of them can be aligned perfectly.
    rpe_translation, rpe_rotation
        Error of the motion from one matched pose to the next [m], [deg]; None for a single pose.
        Without lengths if ``sim3`` has too few poses for the scale.
    rpe_translation_1s, rpe_rotation_1s
        The same over one second; None if the sequence is shorter or has no times.
    t_rel_percent, r_rel_deg_per_100m
        KITTI's mean errors over segments of 100 to 800 m; None for shorter paths.
    """

    matched: Matched
    alignment: Alignment
    transform: Similarity
    single_camera: bool | None
    unit_factor: float | None
    ate: ErrorStatistics | None
    rpe_translation: ErrorStatistics | None
    rpe_rotation: ErrorStatistics | None
    rpe_translation_1s: ErrorStatistics | None
    rpe_rotation_1s: ErrorStatistics | None
    t_rel_percent: float | None
    r_rel_deg_per_100m: float | None

    @property
    def matched_poses(self) -> int:
        """Poses of the estimate that have a true pose at the same time."""
        return self.matched.poses

    @property
    def hint(self) -> str:
        """Return advice if the alignment does not fit the estimate; otherwise empty."""
        if self.alignment is Alignment.SIM3 or self.single_camera is False:
            return ""
        if self.unit_factor is None and not self.single_camera:
            return ""
        factor = "" if self.unit_factor is None else f" (here by {self.unit_factor:.3g})"
        whose = "the estimate is" if self.single_camera else "the estimate looks like one"
        return (
            f"{whose} of a single camera, which cannot see metres: lengths have to be scaled"
            f"{factor} to be compared; give --alignment {Alignment.SIM3}"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the figures under the names in reports; None for missing ones."""
        ate, matched = self.ate, self.matched
        timed = matched.is_timed
        return {
            "matched_poses": matched.poses,
            "matched_of_poses": matched.estimate_poses,
            "matched_from_s": matched.first if timed else None,
            "matched_to_s": matched.last if timed else None,
            "matched_path_m": finite(matched.path),
            "true_path_m": finite(matched.truth_path),
            "time_difference_median_s": matched.median_difference if timed else None,
            "time_difference_max_s": matched.max_difference if timed else None,
            "ate_alignment": str(self.alignment),
            "ate_scale": None if ate is None else self.transform.scale,
            "ate_rmse_m": _rmse(ate),
            "ate_mean_m": None if ate is None else ate.mean,
            "ate_median_m": None if ate is None else ate.median,
            "ate_max_m": None if ate is None else ate.max,
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
    alignment: Alignment | str = Alignment.AUTO,
    *,
    single_camera: bool | None = None,
    max_difference: float = MAX_DIFFERENCE,
    offset: float = 0.0,
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
        ``se3`` for metric estimates, ``sim3`` for those of one camera, ``yaw`` for those with an
        IMU if both worlds have the third axis up, ``none`` if both share one world. With ``sim3``
        the relative errors are those of the scaled estimate. ``auto`` takes ``sim3`` for a single
        camera and ``se3`` for others.
    single_camera
        Whether the estimate is of one camera without depth or an IMU, for ``auto``. If it is not
        known, it is assumed if lengths differ by a factor above 1.5 and scaling halves the error.
    max_difference
        Largest difference of matching time stamps [s].
    offset
        Seconds that are added to the time stamps of the estimate, if the clocks differ.
    timed
        False if the time stamps are only frame numbers: then there are no figures over one second.

    Returns
    -------
    Evaluation
        Positions in metres if the truth is.

    Raises
    ------
    DatasetError
        If no time stamps match, or a pose is invalid: not finite, or without a rotation.
    """
    alignment = Alignment.of(alignment)
    require_trajectories(estimate, truth)
    offset = finite_number(offset, "the offset", "a number of seconds", DatasetError)
    estimate = estimate.select(~estimate.lost).shifted(offset)
    truth = truth.select(~truth.lost)
    i, j = match_poses(estimate, truth, max_difference)
    with np.errstate(all="ignore"):  # what overflows is not finite, and no figure
        unit_factor = _attempt(lambda: differ_in_unit(estimate.positions[i], truth.positions[j]))
        if alignment is Alignment.AUTO:
            single = unit_factor is not None if single_camera is None else single_camera
            alignment = Alignment.SIM3 if single else Alignment.SE3
        transform = _transform(estimate.positions[i], truth.positions[j], alignment)
        figures = _figures(
            transform.apply_to_poses(estimate.T_wc[i]),
            truth.T_wc[j],
            estimate.timestamps[i] if timed else np.zeros(0),
            alignment,
        )
    return Evaluation(
        matched=describe_match(estimate, truth, i, j, timed=timed),
        alignment=alignment,
        transform=transform,
        single_camera=single_camera,
        unit_factor=unit_factor,
        **figures,
    )


def require_trajectories(estimate: Trajectory, truth: Trajectory) -> None:
    """Check that both can be compared.

    Raises
    ------
    DatasetError
        If one is no trajectory, or a pose that is not lost is invalid: not finite, or without a
        rotation.
    """
    for name, trajectory in (("estimate", estimate), ("truth", truth)):
        if not isinstance(trajectory, Trajectory):
            raise DatasetError(f"the {name} is {shown(trajectory)}; give an orbslam2py.Trajectory")
        require_poses(trajectory.T_wc, ~trajectory.lost, f"the {name}")


def finite(value: float | None) -> float | None:
    """Return a value, or None if it is missing or not finite."""
    return value if value is not None and np.isfinite(value) else None


def _transform(points: FloatArray, targets: FloatArray, alignment: Alignment) -> Similarity:
    """Align if possible: figures that need no alignment are computed even without one."""
    if alignment is Alignment.NONE:
        return Similarity.identity()
    if alignment is Alignment.YAW:
        return _attempt(lambda: align_yaw(points, targets)) or Similarity.identity()
    with_scale = alignment is Alignment.SIM3 and len(points) >= alignment.fewest_poses
    found = _attempt(lambda: align(points, targets, with_scale=with_scale))
    return found or Similarity.identity()


def _figures(
    aligned: FloatArray, true: FloatArray, times: FloatArray, alignment: Alignment
) -> dict[str, Any]:
    """Compute every figure separately: a failure does not affect the others."""
    n = len(aligned)
    next_pose = (np.arange(n - 1), np.arange(1, n))
    steps = _relative_statistics(aligned, true, next_pose)
    second = _relative_statistics(aligned, true, one_second_pairs(times))
    segments = segment_errors(aligned, true)
    drift = segments.mean(axis=0) if len(segments) else np.full(2, np.nan)
    has_scale = alignment is not Alignment.SIM3 or n >= alignment.fewest_poses
    distances = np.linalg.norm(aligned[:, :3, 3] - true[:, :3, 3], axis=1)
    return {
        "ate": ErrorStatistics.of(distances) if n >= alignment.fewest_poses else None,
        "rpe_translation": steps[0] if has_scale else None,
        "rpe_rotation": steps[1],
        "rpe_translation_1s": second[0] if has_scale else None,
        "rpe_rotation_1s": second[1],
        "t_rel_percent": finite(float(drift[0] * 100)) if has_scale else None,
        "r_rel_deg_per_100m": finite(float(np.degrees(drift[1]) * 100)),
    }


def relative_errors(
    estimate: FloatArray, truth: FloatArray, pairs: tuple[IntArray, IntArray]
) -> tuple[FloatArray, FloatArray]:
    """Compute the errors of motions between pairs of poses.

    Parameters
    ----------
    estimate, truth
        Poses ``T_wc`` (n, 4, 4) of the same moments.
    pairs
        Indices of the first and the second pose of each motion, (k,) each.

    Returns
    -------
    translations, rotations
        Difference of estimated and true motion, (k,) [m] and (k,) [rad].
    """
    first, second = pairs
    moved = inverse_poses(estimate[first]) @ estimate[second]
    true_moved = inverse_poses(truth[first]) @ truth[second]
    error = inverse_poses(true_moved) @ moved
    return np.linalg.norm(error[:, :3, 3], axis=1), rotation_angles(error[:, :3, :3])


def one_second_pairs(times: FloatArray) -> tuple[IntArray, IntArray]:
    """Pair every pose with the one nearest to a second later, if it is within 0.1 s.

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
    """Compute KITTI's errors over path segments of 100 to 800 m.

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
    along = lengths_along(truth[:, :3, 3])
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


def _attempt(compute: Callable[[], _Value]) -> _Value | None:
    try:
        return compute()
    except np.linalg.LinAlgError:
        return None


def _rmse(statistics: ErrorStatistics | None) -> float | None:
    return None if statistics is None else statistics.rmse
