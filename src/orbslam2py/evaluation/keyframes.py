# SPDX-License-Identifier: BSD-3-Clause
"""Errors of single poses in a map, without the drift of the map.

A pose is compared with the truly nearest keyframe: the estimated motion from the keyframe to the
camera is compared with the true one. The result is the accuracy of localization in a map, even if
the whole map is distorted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation.metrics import relative_errors
from orbslam2py.trajectory.rotations import inverse_poses, rotation_angles


@dataclass(frozen=True)
class PoseError:
    """The error of one pose.

    Attributes
    ----------
    translation_m
        Distance of the two positions [m].
    rotation_deg
        Angle between the two orientations [deg].
    """

    translation_m: float
    rotation_deg: float

    def is_within(self, metres: float, degrees: float) -> bool:
        """Return whether neither value of this error exceeds that of the other."""
        return self.translation_m <= metres and self.rotation_deg <= degrees


def pose_error(estimate: FloatArray, truth: FloatArray) -> PoseError:
    """Compare two poses.

    Parameters
    ----------
    estimate, truth
        Rigid transforms (4, 4) between the same two frames, in metres.
    """
    error = inverse_poses(truth) @ estimate
    angle = rotation_angles(error[None, :3, :3])[0]
    return PoseError(float(np.linalg.norm(error[:3, 3])), float(np.degrees(angle)))


def nearest_keyframes(true_T_wc: FloatArray, true_T_wk: FloatArray) -> IntArray:
    """Find the keyframe nearest to each camera; one metre counts as much as one radian.

    Parameters
    ----------
    true_T_wc
        True poses of the cameras, camera to world (n, 4, 4) [m].
    true_T_wk
        True poses of the keyframes in the same world, (k, 4, 4).

    Returns
    -------
    IntArray
        Indices into the keyframes, (n,).

    Raises
    ------
    DatasetError
        If there are no keyframes.
    """
    if not len(true_T_wk):
        raise DatasetError("no keyframes: errors relative to the nearest one need a map")
    nearest = np.empty(len(true_T_wc), np.int64)
    for i, T_wc in enumerate(true_T_wc):
        distances = np.linalg.norm(true_T_wk[:, :3, 3] - T_wc[:3, 3], axis=1)
        angles = rotation_angles(T_wc[:3, :3].T @ true_T_wk[:, :3, :3])
        nearest[i] = np.argmin(distances + angles)
    return nearest


def errors_through_keyframes(
    T_wc: FloatArray,
    true_T_wc: FloatArray,
    T_wk: FloatArray,
    true_T_wk: FloatArray,
    *,
    metres_per_unit: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Compute the errors of poses relative to the nearest keyframes of their map.

    Parameters
    ----------
    T_wc
        Estimated poses in the world of the map, camera to world (n, 4, 4).
    true_T_wc
        Their true poses in any world, (n, 4, 4) [m].
    T_wk, true_T_wk
        The same of the keyframes, (k, 4, 4) each, at least one.
    metres_per_unit
        Metres per unit of length of the map. Only a single camera needs another value than 1: the
        scale of `align` from estimated to true positions.

    Returns
    -------
    translations, rotations
        Difference of estimated and true motion from the keyframe, (n,) [m] and (n,) [rad].

    Raises
    ------
    DatasetError
        If there are no keyframes.
    """
    nearest = nearest_keyframes(true_T_wc, true_T_wk)
    estimate = np.concatenate([T_wk, T_wc])
    estimate[:, :3, 3] *= metres_per_unit
    pairs = (nearest, len(T_wk) + np.arange(len(T_wc)))
    return relative_errors(estimate, np.concatenate([true_T_wk, true_T_wc]), pairs)
