# SPDX-License-Identifier: BSD-3-Clause
"""Where a frame's first pose comes from, while the map grows and while it stays as it is.

Mur-Artal, Montiel and Tardos, "ORB-SLAM: a Versatile and Accurate Monocular SLAM System", 2015,
sections V-B and V-C; Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III-F.
``docs/method/tracking.md#first-estimate``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.pose_search.search import PoseSearch
from orbslam2py.slam.records import PoseEstimate, Reason


class FirstEstimate(Protocol):
    """A strategy for the first pose of a frame."""

    def estimate(self, frame: core.TrackedFrame, *, lost: bool) -> PoseEstimate:
        """Find a first pose.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        lost : bool
            The frame before has no pose.
        """
        ...

    def reset(self) -> None:
        """Forget the frames before: tracking was lost, or the map is another one."""
        ...

    def believe(self, estimate: PoseEstimate) -> None:
        """Take what was made of the estimate, and is believed."""
        ...


class FirstEstimateInGrowingMap:
    """By the motion model, else the reference keyframe; when lost, anywhere in the map.

    Parameters
    ----------
    search : PoseSearch
        The ways to a pose.
    """

    def __init__(self, search: PoseSearch) -> None:
        self._search = search

    def estimate(self, frame: core.TrackedFrame, *, lost: bool) -> PoseEstimate:
        """See `FirstEstimate`."""
        search = self._search
        if lost:
            relocalized = search.by_relocalization(frame)
            if relocalized.found or not search.has_last_frame:
                return relocalized
        search.follow_map()
        # There is none right after a relocalization, but where a map has just begun.
        if search.motion.velocity is not None:
            estimate = search.by_motion_model(frame)
            if estimate.found:
                return estimate
        estimate = search.by_reference_keyframe(frame)
        if not lost and not estimate.found and search.proving.has_just_begun(frame):
            # Found again where the map ends, the frame before shows most of what this one does.
            standing = search.by_motion_model(frame)
            return standing if standing.found else estimate
        if lost and not estimate.found:
            return estimate.failed(relocalized.reason)
        return estimate

    def reset(self) -> None:
        """Nothing is kept from frame to frame."""

    def believe(self, estimate: PoseEstimate) -> None:
        """Nothing is kept from frame to frame."""


class FirstEstimateInFixedMap:
    """By the motion model or the reference keyframe, also where the map ends.

    There the pose hangs on the depths of the frame before (visual odometry), while every frame is
    also searched in the map.

    Parameters
    ----------
    search : PoseSearch
        The ways to a pose.
    has_depth : bool
        Whether frames measure depths.
    """

    def __init__(self, search: PoseSearch, *, has_depth: bool) -> None:
        self._search = search
        self._has_depth = has_depth
        self.reset()

    def reset(self) -> None:
        """Forget that the last frame hung on depths more than on the map."""
        self._beyond_the_map = False

    def estimate(self, frame: core.TrackedFrame, *, lost: bool) -> PoseEstimate:
        """See `FirstEstimate`."""
        search = self._search
        if lost:
            return search.by_relocalization(frame)
        search.follow_map()
        if self._beyond_the_map:
            estimate = self._back_into_the_map(frame)
        elif search.motion.velocity is not None:
            estimate = self._by_motion_model(frame)
        else:
            estimate = search.by_reference_keyframe(frame)
        return replace(estimate, left_map=estimate.visual_odometry and not self._beyond_the_map)

    def believe(self, estimate: PoseEstimate) -> None:
        """See `FirstEstimate`."""
        self._beyond_the_map = estimate.visual_odometry

    def _by_motion_model(self, frame: core.TrackedFrame) -> PoseEstimate:
        limits = self._search.limits
        estimate = self._search.by_motion_model(frame, beyond_the_map=self._has_depth)
        if not estimate.found or estimate.n_inliers <= limits.localization_matches:
            return estimate.failed(Reason.FEW_MATCHES_LAST_FRAME)
        beyond = core.count_map_points(frame) < limits.map_matches
        return replace(estimate, visual_odometry=beyond)

    def _back_into_the_map(self, frame: core.TrackedFrame) -> PoseEstimate:
        """Go on with visual odometry, unless the map is in view again."""
        search, motion = self._search, self._search.motion
        odometry = PoseEstimate(Reason.FEW_MATCHES_LAST_FRAME)
        if motion.velocity is not None:
            odometry = self._by_motion_model(frame)
            if odometry.found and not odometry.visual_odometry:
                return odometry
        found = core.TrackedFrame(frame.features)
        relocalized = search.by_relocalization(found)
        if not relocalized.found or found.T_cw is None:
            return odometry
        # The odometry's drift ends here and is no motion: the last frame moves along.
        followed = odometry.found and found.map_index == frame.map_index
        if followed and frame.T_cw is not None and motion.last.T_cw is not None:
            motion.jump(motion.last.T_cw @ frame.T_cw.inverse() @ found.T_cw)
        else:
            motion.jump(None)
        frame.copy_associations(found, np.ones(len(frame.features), bool))
        frame.T_cw = found.T_cw
        frame.share_anchor(found)
        return relocalized
