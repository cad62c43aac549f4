# SPDX-License-Identifier: BSD-3-Clause
"""What a search for a pose gives, and what tracking one frame gives."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from orbslam2py.slam.records import FloatArray, Reason, TrackingState

IdArray = npt.NDArray[np.int64]


def _nothing() -> IdArray:
    return np.zeros(0, np.int64)


@dataclass(frozen=True)
class PoseEstimate:
    """What one step of tracking found out about a frame's pose.

    If it was found, the frame holds pose and associations. A step that fails leaves them
    undefined: the next one begins anew.
    """

    reason: Reason = Reason.NONE
    """Why there is no pose."""
    n_matches: int = 0
    """Keypoints matched to map points before the pose was optimised."""
    n_inliers: int = 0
    """Of these, accepted by the optimisation."""
    covariance: FloatArray | None = None
    """(6, 6), see `TrackingRecord.covariance`."""
    discarded: IdArray = field(default_factory=_nothing)
    """Ids of the points that were matched and thrown out as outliers, ascending."""
    visual_odometry: bool = False
    """The pose hangs on the depths of the frame before more than on the map."""
    relocalized: bool = False
    """Found without a guess from the frame before."""

    @property
    def found(self) -> bool:
        """Whether there is a pose."""
        return self.reason is Reason.NONE

    def failed(self, reason: Reason) -> PoseEstimate:
        """The same, but not believed."""
        return replace(self, reason=reason)


@dataclass(frozen=True)
class TrackingOutcome:
    """What tracking one frame gave."""

    state: TrackingState
    estimate: PoseEstimate
    is_keyframe: bool = False
    reset_needed: bool = False
    """The map was lost so soon that it is better to begin another one."""
