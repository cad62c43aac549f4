# SPDX-License-Identifier: BSD-3-Clause
"""Refinement of poses by the points of the local map.

Mur-Artal, Montiel and Tardos, 2015, section V-D; ``docs/method/tracking.md#local-map``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import IntArray
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
        return 0.0 if covariance is None else core.position_deviation(covariance)

    @cached_property
    def spread(self) -> core.InlierSpread:
        """Return how the inliers are distributed over image and depth, and their common errors."""
        return core.spread_of_inliers(self.frame)


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
        self._alignment = alignment
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
        n_held = frame.n_associated()
        window = self._usual_window
        just_begun = state.has_just_begun(frame.id, self._limits)
        if just_begun:
            window = self._limits.local_map_window_after_relocalization
        matches = core.match_local_map(frame, local_map.points, first.discarded, window)
        optimized = core.optimize_pose(frame)
        visible = matches.visible
        found_again = just_begun and state.found_again
        if found_again and optimized.n_inliers >= self._limits.map_matches:
            # Wide windows find much that is wrong; where the camera is now, narrow ones find more.
            frame.discard_outliers()
            core.match_local_map(frame, local_map.points, first.discarded, self._usual_window)
            optimized = core.optimize_pose(frame)
        optimized = self._aligned(frame, optimized)
        by_image, fused = frame.T_cw, _fused(frame, optimized, state)
        estimate = self._enough_found(frame, first, fused or optimized)
        if fused is not None:
            estimate = replace(estimate, by_image=by_image)
        if estimate.visual_odometry:
            return _beyond_the_map(frame, estimate, state)
        return RefinedPose(frame, estimate, local_map, visible, n_held + len(visible))

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
        frame = core.TrackedFrame(refined.frame.features)
        frame.T_cw = refined.frame.T_cw
        frame.share_anchor(refined.frame)
        nothing = np.zeros(0, np.int64)
        for window in (_AFRESH_WINDOW, self._usual_window):
            frame.clear_associations()
            visible = core.match_local_map(frame, local_map.points, nothing, window).visible
            optimized = core.optimize_pose(frame)
        optimized = self._aligned(frame, optimized)
        share = limits.afresh_share_in_doubt if in_doubt else limits.afresh_share
        elsewhere = in_doubt or _is_elsewhere(frame, refined)
        if optimized.n_inliers < share * n_of_map or not elsewhere:
            return refined
        estimate = self._enough_found(frame, refined.estimate, optimized)
        if estimate.visual_odometry or not estimate.found:
            return refined
        return RefinedPose(frame, estimate, local_map, visible, len(visible))

    def _aligned(self, frame: core.TrackedFrame, optimized: core.PoseEstimate) -> core.PoseEstimate:
        """Optimize once more with inliers at the places where patches put them."""
        enough = optimized.n_inliers >= self._limits.local_map_inliers
        alignment = self._alignment
        if alignment is None or not (alignment.tracked_inliers and enough):
            return optimized
        core.align_frame(self._map, frame, alignment.tracked_inliers, alignment.noise)
        return core.optimize_pose(frame)

    def _enough_found(
        self,
        frame: core.TrackedFrame,
        first: PoseEstimate,
        optimized: core.PoseEstimate,
    ) -> PoseEstimate:
        """Return the pose with its matches in the local map."""
        estimate = PoseEstimate(
            n_matches=frame.n_associated(),
            n_inliers=optimized.n_inliers,
            covariance=optimized.covariance,
            discarded=first.discarded,
            relocalized=first.relocalized,
        )
        if estimate.n_inliers < self._limits.local_map_inliers:
            return estimate.failed(Reason.FEW_INLIERS_LOCAL_MAP)
        if frame.n_map_inliers() < self._limits.map_matches:
            # What the frame before measured speaks for itself, and says nothing of the map.
            return replace(estimate, visual_odometry=True)
        return estimate


def _fused(
    frame: core.TrackedFrame, optimized: core.PoseEstimate, state: State
) -> core.PoseEstimate | None:
    """Optimize a pose again with the prediction of an IMU, unless that costs inliers."""
    prior = state.motion.prior()
    if prior is None:
        return None
    T_cw = frame.T_cw
    fused = core.optimize_pose(frame, prior)
    if fused.n_inliers >= _KEPT * optimized.n_inliers:
        return fused
    frame.T_cw = T_cw
    core.optimize_pose(frame)
    return None


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
