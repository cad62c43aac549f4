# SPDX-License-Identifier: BSD-3-Clause
"""The decision whether a frame becomes a keyframe.

Mur-Artal, Montiel and Tardos, 2015, section V-E; close points: Mur-Artal and Tardos, 2017, section
III-E; ``docs/method/tracking.md#new-keyframes``.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py._worker import Worker
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import KeyframeConfig
from orbslam2py.slam.state import SinceKeyframe

_TURN_FRAMES = 3  # frames that the view is predicted ahead: a keyframe needs as long to be mapped
_QUEUE = 3  # keyframes that may wait for the mapper, with depth (ORB-SLAM2)


class KeyframeDecision:
    """Compares the benefit of a new keyframe with the load of mapping.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    mapping : Worker
        Local mapping; it shortens its work if it is busy and a keyframe is wanted.
    sensor : Sensor
        The sensor.
    max_keyframe_interval : int
        Frames after which a keyframe is wanted even if mapping is busy: one second.
    config : KeyframeConfig
        Limits.
    waits : bool
        Images are recorded: a frame that should become a keyframe waits for mapping.
    """

    def __init__(
        self,
        slam_map: core.Map,
        mapping: Worker[int],
        sensor: Sensor,
        max_keyframe_interval: int,
        config: KeyframeConfig,
        *,
        waits: bool = False,
    ) -> None:
        self._map = slam_map
        self._mapping = mapping
        self._has_depth = sensor.has_depth
        self._max_keyframe_interval = max_keyframe_interval
        self.limits = config
        #: Fewest frames from one keyframe to the next.
        self.spacing = config.spacing_with_depth if sensor.has_depth else 1
        self._waits = waits

    def wanted(
        self,
        frame: core.TrackedFrame,
        reference_keyframe: int,
        n_inliers: int,
        velocity: core.Velocity | None,
        since: SinceKeyframe,
    ) -> bool:
        """Return whether a tracked frame becomes a keyframe now.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame, with its associations.
        reference_keyframe : int
            The keyframe that shares most points with the frame.
        n_inliers : int
            Of its pose.
        velocity : Velocity or None
            At this frame, if known.
        since : SinceKeyframe
            Counts of the frames since the last keyframe, with this one.
        """
        if self._mapping.pausing:
            return False
        limits = self.limits
        n_keyframes = self._map.n_active_keyframes
        n_reference = self._points_of(reference_keyframe, n_keyframes)
        loses_what_it_saw = n_inliers < limits.kept_share * since.most_inliers
        needs_new_points = self._has_depth and (
            loses_what_it_saw
            or self._lacks_close_points(frame)
            or self._turns_away(frame, n_inliers, velocity)
        )
        n_frames = frame.id - since.frame_id
        one_second_passed = n_frames >= self._max_keyframe_interval
        tracking_is_weak = self._has_depth and (
            n_inliers < limits.weak_share * n_reference or needs_new_points
        )
        sees_new_things = (
            n_inliers < self._share(n_keyframes) * n_reference
            or needs_new_points
            or self._hangs_on_few(frame, n_inliers, since)
        )
        worth_it = sees_new_things and n_inliers > limits.inliers
        due = n_frames >= self.spacing
        if worth_it and due and self._waits:
            # Frames alone count, not how fast the mapper is.
            self._mapping.wait_until_idle(unless_held=True)
        idle = self._mapping.idle
        wanted = worth_it and (one_second_passed or (idle and due) or tracking_is_weak)
        if not wanted or idle:
            return wanted
        self._mapping.interrupt()
        # A busy mapper gets no keyframes of a single camera: they would come at every frame.
        queue = _QUEUE if self._has_depth else 0
        return self._mapping.n_waiting < queue

    def _points_of(self, keyframe: int, n_keyframes: int) -> int:
        few = n_keyframes <= self.limits.few_keyframes
        observations = self.limits.few_keyframes if few else self.limits.observations
        return core.count_tracked_points(self._map, keyframe, observations)

    def _share(self, n_keyframes: int) -> float:
        if not self._has_depth:
            return self.limits.share_monocular
        return self.limits.share_of_first if n_keyframes < 2 else self.limits.share

    def _hangs_on_few(self, frame: core.TrackedFrame, n_inliers: int, since: SinceKeyframe) -> bool:
        """Return whether a single camera has few points, and has moved enough to create new ones.

        The reference keyframe cannot decide this: its points count only if three keyframes see
        them, and a fast camera has few such points.
        """
        limits = self.limits
        T_cw = frame.T_cw
        if self._has_depth or n_inliers >= limits.few_inliers or T_cw is None:
            return False
        if self._map.map_of(since.keyframe) != self._map.active_map:
            return True  # nothing was added to this map yet
        center = self._map.keyframe_pose(since.keyframe).center
        T_there = core.Pose(T_cw.quaternion_xyzw, -T_cw.matrix[:3, :3] @ center)
        return core.median_displacement(frame, T_there) > limits.new_view

    def _lacks_close_points(self, frame: core.TrackedFrame) -> bool:
        tracked, untracked = frame.n_close_tracked_untracked()
        limits = self.limits
        return tracked < limits.few_close_points and untracked > limits.many_untracked_close_points

    def _turns_away(
        self, frame: core.TrackedFrame, n_inliers: int, velocity: core.Velocity | None
    ) -> bool:
        """Return whether the tracked points will leave the view soon and others can follow."""
        if velocity is None:
            return False
        staying = core.count_staying_after(frame, velocity, _TURN_FRAMES)
        if staying >= self.limits.kept_share * n_inliers:
            return False
        _, untracked = frame.n_close_tracked_untracked()
        return untracked > self.limits.many_untracked_close_points
