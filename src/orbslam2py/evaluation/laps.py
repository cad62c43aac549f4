# SPDX-License-Identifier: BSD-3-Clause
"""The drift of a lap: error of the motion from start to end, and change of scale.

Alignment of the whole path hides both; they show the quality of a loop closure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation.matching import match_poses, time_order
from orbslam2py.evaluation.metrics import relative_errors
from orbslam2py.trajectory import (
    MAX_DIFFERENCE,
    Similarity,
    Trajectory,
    align,
    lengths_along,
)
from orbslam2py.trajectory.rotations import require_poses


@dataclass(frozen=True)
class LapError:
    """Error of one motion from the start of a path to its end.

    Attributes
    ----------
    translation_m
        Distance of the estimated end from the true one, both in the frame of the start [m].
    rotation_deg
        Angle between the estimated and the true rotation from start to end [deg].
    path_m
        Length of the true path between them [m].
    """

    translation_m: float
    rotation_deg: float
    path_m: float

    @property
    def percent(self) -> float:
        """`translation_m` per `path_m`, in percent."""
        return 100 * self.translation_m / self.path_m


def lap_error(
    estimate: Trajectory,
    truth: Trajectory,
    length: float | None = None,
    *,
    with_scale: bool = False,
    max_difference: float = MAX_DIFFERENCE,
) -> LapError:
    """Compute the error of the motion from the start of a lap to its end.

    Parameters
    ----------
    estimate
        Lost poses are left out.
    truth
        True poses of the same camera in any world.
    length
        Length of the lap along the true path [m]; by default it ends with the last pose.
    with_scale
        For one camera: the estimate is first scaled so that it fits the true path best.
    max_difference
        Largest difference of matching time stamps [s].

    Raises
    ------
    DatasetError
        If no time stamps match, a pose is invalid, or the estimate ends before the lap.
    """
    estimated, true, along = _lap(estimate, truth, length, max_difference)
    ends = (np.array([0]), np.array([len(true) - 1]))
    if with_scale:
        scale = align(estimated[:, :3, 3], true[:, :3, 3], with_scale=True).scale
        estimated = Similarity(scale, np.eye(3), np.zeros(3)).apply_to_poses(estimated)
    translations, rotations = relative_errors(estimated, true, ends)
    return LapError(float(translations[0]), float(np.degrees(rotations[0])), float(along[-1]))


def scale_drift(
    estimate: Trajectory,
    truth: Trajectory,
    length: float | None = None,
    *,
    window: float | None = None,
    max_difference: float = MAX_DIFFERENCE,
) -> float:
    """Compute the change of scale over a lap: 0.02 if its end is 2 % larger than its start.

    Parameters
    ----------
    estimate
        Lost poses are left out.
    truth
        True poses of the same camera in any world.
    length
        Length of the lap along the true path [m]; by default it ends with the last pose.
    window
        Length of the two windows at the start and the end of the lap [m]. Each is aligned to the
        ground truth to measure its scale. By default a tenth of the lap.
    max_difference
        Largest difference of matching time stamps [s].

    Raises
    ------
    DatasetError
        If no time stamps match, a pose is invalid, the estimate ends before the lap, or a window
        contains fewer than three poses.
    """
    estimated, true, along = _lap(estimate, truth, length, max_difference)
    metres = 0.1 * along[-1] if window is None else window
    scales = []
    for inside in (along <= metres, along >= along[-1] - metres):
        if inside.sum() < 3:
            raise DatasetError(f"fewer than three poses within {metres:.2f} m show no scale")
        # Onto the estimate, whose scale is asked for; the truth has no noise to shrink it.
        fit = align(true[inside, :3, 3], estimated[inside, :3, 3], with_scale=True)
        scales.append(fit.scale)
    return scales[1] / scales[0] - 1


def _lap(
    estimate: Trajectory, truth: Trajectory, length: float | None, max_difference: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Poses (n, 4, 4) of the lap, estimated and true, and metres from its start (n,)."""
    for name, trajectory in (("estimate", estimate), ("truth", truth)):
        if not isinstance(trajectory, Trajectory):
            raise DatasetError(f"the {name} is {shown(trajectory)}; give an orbslam2py.Trajectory")
        require_poses(trajectory.T_wc, ~trajectory.lost, f"the {name}")
    estimate = estimate.select(~estimate.lost)
    truth = truth.select(~truth.lost)
    truth = truth.select(time_order(truth))
    i, j = match_poses(estimate, truth, max_difference)
    # Along all true poses: the path length also counts gaps of the estimate.
    along = lengths_along(truth.positions)[j]
    along -= along[0]
    n = len(along)
    if length is not None:
        n = int(np.searchsorted(along, length)) + 1
        if n > len(along):
            raise DatasetError(
                f"the estimate ends after {along[-1]:.2f} m of a lap of {length:.2f} m"
            )
    if not along[n - 1] > 0:
        raise DatasetError("the camera did not move; a lap needs a path")
    return estimate.T_wc[i[:n]], truth.T_wc[j[:n]], along[:n]
