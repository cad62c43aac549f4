# SPDX-License-Identifier: BSD-3-Clause
"""Localization mode: poses in a map that stays as it is.

Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III-F;
``docs/method/tracking.md#localization-mode``.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from orbslam2py import _core as core
from orbslam2py._worker import PauseTicket, Worker
from orbslam2py.slam.pose_search import PoseSearch
from orbslam2py.slam.records import PoseEstimate, Reason

_log = logging.getLogger(__name__)


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
        if estimate.found:
            self._beyond_the_map = estimate.visual_odometry
        return estimate

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


class LocalizationSwitch:
    """Holds the workers still while only poses are wanted.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    min_keyframes : int
        How many keyframes begin a map; with fewer, mapping goes on until it has begun.
    workers : iterable of Worker
        Stand still in localization mode; what waits for them is processed afterwards.
    """

    def __init__(
        self, slam_map: core.Map, min_keyframes: int, workers: Iterable[Worker[int]]
    ) -> None:
        self._map = slam_map
        self._min_keyframes = min_keyframes
        self._workers = tuple(workers)
        self._tickets: list[PauseTicket] = []
        #: The mode that the next image will be tracked in; the last assignment counts.
        self.wanted = False
        #: The mode in force.
        self.on = False

    @property
    def _n_keyframes(self) -> int:
        return int(self._map.n_keyframes_of(self._map.active_map))

    def apply(self) -> None:
        """Carry out the switch, between two frames."""
        wanted = self.wanted and self._n_keyframes >= self._min_keyframes
        if wanted == self.on:
            return
        if wanted:
            self._tickets = [worker.pause() for worker in self._workers]
            for ticket in self._tickets:
                ticket.wait()
        else:
            self.release()
        self.on = wanted
        _log.info("localization mode %s", "on" if wanted else "off")

    def release(self) -> None:
        """Let the workers go on; what waits for them is processed."""
        for ticket in self._tickets:
            ticket.release()
        self._tickets = []
