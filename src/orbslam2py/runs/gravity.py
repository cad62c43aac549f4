# SPDX-License-Identifier: BSD-3-Clause
"""The up direction in the frame of the first keyframe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.evaluation import match_poses
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import nearest_rotations

#: Where up is in a camera that is held level.
_UP_IN_CAMERA = np.array([0.0, -1.0, 0.0])
#: Cosine of the angle between up and the cameras' own up, on average: below, a file of ground truth
#: has another world than its layout promises (or the camera looks down), and nothing is claimed.
_LEAST_AGREEMENT = 0.5


@dataclass(frozen=True, eq=False)
class Height:
    """The direction of height, and its name."""

    up: FloatArray
    """Unit vector (3,) in the frame of the first keyframe's camera."""
    label: str
    """Name for an axis."""

    @classmethod
    def of_first_keyframe(cls) -> Height:
        """Use the first camera's own up direction, if its orientation is unknown."""
        return cls(_UP_IN_CAMERA, "up in the\nfirst keyframe")

    @classmethod
    def of_level_axes(cls) -> Height:
        """Use the up direction of level axes (`level_frame`)."""
        return cls(_UP_IN_CAMERA, "height over\nthe start")

    def of(self, positions: FloatArray) -> FloatArray:
        """Height (n,) of positions (n, 3) above the first keyframe."""
        return np.asarray(positions @ self.up)


def height_of(sequence: Any, estimate: Trajectory, truth: Trajectory | None) -> Height:
    """Find the direction of gravity by a ground truth whose world has a known one.

    Parameters
    ----------
    sequence
        The source of the images; its ``up_in_truth`` is the up direction in the world of its ground
        truth, None or missing if unknown.
    estimate
        Tracked poses.
    truth
        Ground truth in its own world.

    Returns
    -------
    Height
        Along gravity, or along the up direction of the first keyframe if gravity is unknown.
    """
    up_in_truth = getattr(sequence, "up_in_truth", None)
    if up_in_truth is None or truth is None or not len(estimate):
        return Height.of_first_keyframe()
    i, j = match_poses(estimate, truth)
    # By the orientations: positions along a straight way leave the turn around it open.
    R_estimate_truth = nearest_rotations(
        np.sum(estimate.T_wc[i, :3, :3] @ np.swapaxes(truth.T_wc[j, :3, :3], 1, 2), axis=0)
    )
    up: FloatArray = R_estimate_truth @ (up_in_truth / np.linalg.norm(up_in_truth))
    if float(np.mean(estimate.T_wc[i, :3, :3] @ _UP_IN_CAMERA @ up)) < _LEAST_AGREEMENT:
        return Height.of_first_keyframe()
    return Height(up, "height over\nthe start")
