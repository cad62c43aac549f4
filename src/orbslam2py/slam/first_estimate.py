# SPDX-License-Identifier: BSD-3-Clause
"""The first estimate of a frame's pose, while the map grows.

Mur-Artal, Montiel and Tardos, 2015, sections V-B and V-C;
``docs/method/tracking.md#first-estimate``. `localization_mode` has the other strategy.
"""

from __future__ import annotations

from typing import Protocol

from orbslam2py import _core as core
from orbslam2py.slam.estimates import PoseEstimate
from orbslam2py.slam.pose_search import PoseSearch
from orbslam2py.slam.records import Reason


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
            estimate = search.by_relocalization(frame)
            if estimate.found:
                return estimate
        search.follow_map()
        if search.motion.velocity is not None and not search.just_relocalized(frame):
            estimate = search.by_motion_model(frame)
            if estimate.found:
                return estimate
        estimate = search.by_reference_keyframe(frame)
        if lost and not estimate.found:
            return estimate.failed(Reason.NOT_FOUND_IN_MAP)
        return estimate

    def reset(self) -> None:
        """Nothing is kept from frame to frame."""
