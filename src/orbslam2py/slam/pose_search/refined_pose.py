# SPDX-License-Identifier: BSD-3-Clause
"""What is known of a frame's pose once the map around it was searched."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from orbslam2py import _core as core
from orbslam2py._arrays import IntArray
from orbslam2py.slam.records import PoseEstimate


@dataclass(frozen=True)
class RefinedPose:
    """A pose with all that was found of the map around it."""

    frame: core.TrackedFrame
    """Holds pose and associations."""
    estimate: PoseEstimate
    local_map: core.LocalMap | None
    """Where it was searched; None where the pose is settled by visual odometry alone."""
    visible: IntArray
    """Ids of the points in view that the first estimate did not hold."""
    n_predicted: int
    """Points that should be in view."""

    @cached_property
    def position_deviation(self) -> float:
        """Standard deviation of the position, all directions together [m]; 0 if not known."""
        covariance = self.estimate.covariance
        return 0.0 if covariance is None else core.position_deviation(covariance)

    @cached_property
    def spread(self) -> core.InlierSpread:
        """How the inliers are spread over image and depth, and how far they are wrong together."""
        return core.spread_of_inliers(self.frame)
