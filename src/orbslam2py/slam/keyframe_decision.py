# SPDX-License-Identifier: BSD-3-Clause
"""Which frames become keyframes.

Mur-Artal, Montiel and Tardos, 2015, section V-E; close points: Mur-Artal and Tardos, 2017, section
III-E.
"""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py import _core as core
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.tracking_types import TrackingThresholds
from orbslam2py.slam.worker import Worker


@dataclass(frozen=True)
class KeyframeClock:
    """Ids of frames in which something happened last."""

    last_keyframe: int
    last_relocalization: int


class KeyframeDecision:
    """Weighs what a frame would bring to the map against what mapping can take.

    Parameters
    ----------
    world : orbslam2py._core.Map
        The map.
    mapping : Worker
        Takes the keyframes; asked to hurry when it is busy and one is wanted.
    sensor : Sensor
        What the images come from.
    max_frames : int
        Largest spacing of keyframes in frames: one second.
    thresholds : TrackingThresholds
        Limits.
    """

    def __init__(
        self,
        world: core.Map,
        mapping: Worker[int],
        sensor: Sensor,
        max_frames: int,
        thresholds: TrackingThresholds,
    ) -> None:
        self._map = world
        self._mapping = mapping
        self._has_depth = sensor.has_depth
        self._max_frames = max_frames
        self.limits = thresholds

    def wanted(
        self,
        frame: core.TrackedFrame,
        reference_keyframe: int,
        n_inliers: int,
        last: KeyframeClock,
    ) -> bool:
        """Whether a tracked frame is to become a keyframe now.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            With its associations.
        reference_keyframe : int
            Shares most points with it.
        n_inliers : int
            Of its pose.
        last : KeyframeClock
            When the last keyframe was made, and the last relocalization.
        """
        n_keyframes = self._map.n_keyframes
        if self._mapping.pausing:
            return False
        recently_relocalized = frame.id < last.last_relocalization + self._max_frames
        if recently_relocalized and n_keyframes > self._max_frames:
            return False

        min_observations = 2 if n_keyframes <= 2 else 3
        n_reference = core.count_tracked_points(self._map, reference_keyframe, min_observations)
        needs_close_points = self._has_depth and self._lacks_close_points(frame)
        idle = self._mapping.idle
        ratio = 0.4 if n_keyframes < 2 else 0.75
        if not self._has_depth:
            ratio = 0.9

        one_second_passed = frame.id >= last.last_keyframe + self._max_frames
        tracking_is_weak = self._has_depth and (
            n_inliers < 0.25 * n_reference or needs_close_points
        )
        sees_new_things = n_inliers < ratio * n_reference or needs_close_points
        wanted = (one_second_passed or idle or tracking_is_weak) and (
            sees_new_things and n_inliers > self.limits.reference_matches
        )
        if not wanted or idle:
            return wanted
        self._mapping.interrupt()
        # A busy mapper gets no keyframes of a single camera: they would come at every frame.
        queue = self.limits.keyframe_queue if self._has_depth else 0
        return self._mapping.n_waiting < queue

    def _lacks_close_points(self, frame: core.TrackedFrame) -> bool:
        tracked, untracked = frame.n_close_tracked_untracked()
        limits = self.limits
        return tracked < limits.few_close_points and untracked > limits.many_untracked_close_points
