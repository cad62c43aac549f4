# SPDX-License-Identifier: BSD-3-Clause
"""What a system tells of itself, while it runs and afterwards."""

from __future__ import annotations

import threading

from orbslam2py import _core as core
from orbslam2py.maps.snapshot import (
    MapSnapshot,
    frame_trajectory,
    keyframe_trajectory,
    take_snapshot,
)
from orbslam2py.slam.back_end import BackEnd
from orbslam2py.slam.events import LoopClosed
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord
from orbslam2py.slam.records import TrackingState
from orbslam2py.slam.timing import StageStatistics
from orbslam2py.slam.tracking import Tracking
from orbslam2py.trajectory.trajectory import Trajectory


class SystemResults:
    """The part of `orbslam2py.System` that only looks: copies, safe to take from any thread."""

    _map: core.Map
    _back_end: BackEnd
    _tracking: Tracking
    _statistics: StageStatistics
    _recorder: core.TrajectoryRecorder
    _trajectory_lock: threading.Lock
    _finished_trajectories: list[Trajectory]

    @property
    def state(self) -> TrackingState:
        """State after the last track call."""
        return self._tracking.state

    @property
    def n_keyframes(self) -> int:
        """Keyframes in the map."""
        return int(self._map.n_keyframes)

    @property
    def n_map_points(self) -> int:
        """Points in the map."""
        return int(self._map.n_points)

    @property
    def n_loops_closed(self) -> int:
        """Loops closed so far, over all maps."""
        return len(self._back_end.loop_closing.loops)

    @property
    def loops(self) -> list[LoopClosed]:
        """The loops closed so far, over all maps."""
        return list(self._back_end.loop_closing.loops)

    @property
    def full_adjustments(self) -> list[FullAdjustmentRecord]:
        """The full bundle adjustments so far, also those that were given up."""
        return list(self._back_end.adjustment.records)

    @property
    def n_relocalizations(self) -> int:
        """How often tracking was found again after a loss."""
        return self._tracking.n_relocalizations

    def trajectory(self) -> Trajectory:
        """Poses of all images of the present map, after the latest optimisation.

        Returns
        -------
        Trajectory
            Time stamps, ``T_wc`` (n, 4, 4) relative to keyframe 0, and which frames were lost.
        """
        return self.trajectories()[-1]

    def trajectories(self) -> list[Trajectory]:
        """One trajectory per map: those ended by resets, then the present one."""
        with self._trajectory_lock:
            present = frame_trajectory(self._recorder, self._map)
            return [*self._finished_trajectories, present]

    def keyframe_trajectory(self) -> Trajectory:
        """Poses of the keyframes, relative to keyframe 0."""
        return keyframe_trajectory(self._map)

    def map_snapshot(self) -> MapSnapshot:
        """A copy of keyframe poses and points; may be called while the system runs."""
        return take_snapshot(self._map)

    def map_hash(self) -> int:
        """Hash over poses, points and observations: equal for equal maps."""
        return int(self._map.content_hash())

    def check_map(self) -> list[str]:
        """Violated invariants of the map, one sentence each; empty if it is consistent."""
        return list(core.check_invariants(self._map, require_words=True))

    def stage_statistics(self) -> dict[str, dict[str, float]]:
        """Median, mean and p99 milliseconds per stage of tracking, mapping and loop closing."""
        return {**self._statistics.summary(), **self._back_end.statistics()}
