# SPDX-License-Identifier: BSD-3-Clause
"""Refinement of poses by the points of the local map.

Mur-Artal, Montiel and Tardos, 2015, section V-D; ``docs/method/tracking.md#local-map``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._values import replace
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import AlignmentConfig, TrackingConfig
from orbslam2py.slam.records import PoseEstimate, Reason
from orbslam2py.slam.state import State

_AFRESH_WINDOW = 3.0  # factor on the search radius, for a pose that may be off by more than usual
_KEPT = 0.95  # share of the inliers that a pose must keep with the prediction of an IMU
_ELSEWHERE = 3.0  # standard deviations: 99 % of two poses of one camera are nearer


@dataclass(frozen=True)
class RefinedPose:
    """A refined pose with its matches in the local map."""

    frame: core.TrackedFrame
    """Holds pose and associations."""
    estimate: PoseEstimate
    local_map: core.LocalMap | None
    """The local map; None if the pose is from visual odometry alone."""
    visible: IntArray
    """Ids of the points in view without a match in the first estimate."""
    n_predicted: int
    """Points that should be in view."""

    @cached_property
    def position_deviation(self) -> float:
        """Return the standard deviation of the position over all directions [m]; 0 if not known."""
        covariance = self.estimate.covariance
        variance = 0.0 if covariance is None else covariance[3:, 3:].trace()
        return math.sqrt(max(0.0, variance))

    @cached_property
    def evidence(self) -> tuple[int, int, float, FloatArray]:
        """Return the evidence of the matches for the pose; see `orbslam2py._core.pose_evidence`."""
        return core.pose_evidence(self.frame)


class LocalMapSearch:
    """Matches frames with the points of the local map, in a window that depends on the state.

    It stores nothing about a frame, because several hypotheses may be refined.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    sensor : Sensor
        The sensor.
    config : TrackingConfig
        Limits.
    alignment : AlignmentConfig or None
        How many inliers are aligned to the patches of their points at the end; None: none.
    """

    def __init__(
        self,
        slam_map: core.Map,
        sensor: Sensor,
        config: TrackingConfig,
        alignment: AlignmentConfig | None = None,
    ) -> None:
        self._map = slam_map
        self._limits = config
        self._n_aligned = 0 if alignment is None else alignment.tracked_inliers
        is_rgbd = sensor is Sensor.RGBD
        self._usual_window = config.local_map_window_rgbd if is_rgbd else config.local_map_window

    def refine(self, frame: core.TrackedFrame, first: PoseEstimate, state: State) -> RefinedPose:
        """Refine a first estimate with all points of the local map, and count the matches.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            It has the pose and the associations of the first estimate.
        first : PoseEstimate
            The first estimate.
        state : State
            Whether the search window is wide.

        Returns
        -------
        RefinedPose
            Its estimate says whether the frame was found.
        """
        if first.visual_odometry:
            return _beyond_the_map(frame, first, state)
        local_map = core.select_local_map(self._map, frame)
        window = self._usual_window
        just_begun = state.has_just_begun(frame.id, self._limits)
        if just_begun:
            window = self._limits.local_map_window_after_relocalization
        visible, n_predicted = core.match_local_map(frame, local_map, first.discarded, window)
        found_again = just_begun and state.found_again
        if found_again and core.optimize_pose(frame).n_inliers >= self._limits.map_matches:
            # Wide windows find much that is wrong; where the camera is now, narrow ones find more.
            frame.discard_outliers()
            core.match_local_map(frame, local_map, first.discarded, self._usual_window)
        estimate = self._optimized(frame, first, state.motion.prior())
        if estimate.visual_odometry:
            return _beyond_the_map(frame, estimate, state)
        return RefinedPose(frame, estimate, local_map, visible, n_predicted)

    def rematch(self, refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        """Match a frame with the map again, without its associations.

        Matches are inherited from frame to frame, which biases the pose towards its predecessor. In
        a fixed map, the pose of an image must not depend on the images before it.

        Parameters
        ----------
        refined : RefinedPose
            Initial pose of the search. It is not changed.
        in_doubt : bool
            Whether the pose had few or wrong matches: then any result of the search is accepted.

        Returns
        -------
        RefinedPose
            The pose of the new search if it clearly differs, or in doubt always; the given pose if
            the search finds too little.
        """
        limits, local_map = self._limits, refined.local_map
        n_of_map = refined.frame.n_map_inliers()
        # Depths that the frame before measured hold it as well, and make it steadier.
        is_steady = n_of_map < refined.estimate.n_inliers and not in_doubt
        if local_map is None or refined.frame.T_cw is None or is_steady:
            return refined
        frame = refined.frame.pose_alone()
        nothing = np.zeros(0, np.int64)
        core.match_local_map(frame, local_map, nothing, _AFRESH_WINDOW)
        core.optimize_pose(frame)
        frame.clear_associations()
        visible, n_predicted = core.match_local_map(frame, local_map, nothing, self._usual_window)
        estimate = self._optimized(frame, refined.estimate, None)
        share = limits.afresh_share_in_doubt if in_doubt else limits.afresh_share
        elsewhere = in_doubt or _is_elsewhere(frame, refined)
        if estimate.n_inliers < share * n_of_map or not elsewhere:
            return refined
        if estimate.visual_odometry or not estimate.found:
            return refined
        return RefinedPose(frame, estimate, local_map, visible, n_predicted)

    def _optimized(
        self, frame: core.TrackedFrame, first: PoseEstimate, prior: core.PosePrior | None
    ) -> PoseEstimate:
        """Optimize the pose, with aligned inliers and the prediction of an IMU; weigh the matches.

        With the prediction, the pose must keep nearly all inliers; otherwise it is that of the
        image.
        """
        limits = self._limits
        n_inliers, n_matches, n_of_map, covariance = core.optimize_aligned(
            self._map, frame, self._n_aligned, limits.local_map_inliers
        )
        by_image = None
        if prior is not None:
            by_image = frame.T_cw
            fused = core.optimize_pose(frame, prior)
            if fused.n_inliers >= _KEPT * n_inliers:
                n_inliers, covariance = fused.n_inliers, fused.covariance
                n_of_map = frame.n_map_inliers()
            else:
                frame.T_cw, by_image = by_image, None
                core.optimize_pose(frame)
        estimate = PoseEstimate(
            n_matches=n_matches,
            n_inliers=n_inliers,
            covariance=covariance,
            discarded=first.discarded,
            relocalized=first.relocalized,
            by_image=by_image,
        )
        if n_inliers < limits.local_map_inliers:
            return estimate.failed(Reason.FEW_INLIERS_LOCAL_MAP)
        if n_of_map < limits.map_matches:
            # Temporary points come from the frame before, and are no evidence for a place in the
            # map.
            return replace(estimate, visual_odometry=True)
        return estimate


def _beyond_the_map(frame: core.TrackedFrame, odometry: PoseEstimate, state: State) -> RefinedPose:
    """Use a pose from the depths of the last frame; these points should be in view."""
    assert frame.T_cw is not None
    n_predicted = core.count_staying(state.motion.last, frame.T_cw)
    return RefinedPose(frame, odometry, None, np.zeros(0, np.int64), n_predicted)


def _is_elsewhere(frame: core.TrackedFrame, refined: RefinedPose) -> bool:
    """Return whether another pose of a frame is several standard deviations from a refined pose."""
    T_cw = refined.frame.T_cw
    assert T_cw is not None and frame.T_cw is not None
    _, move = frame.T_cw.difference(T_cw)
    return move > _ELSEWHERE * refined.position_deviation
