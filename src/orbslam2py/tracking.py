# SPDX-License-Identifier: BSD-3-Clause
"""Tracking: the pose of every image, and which images become keyframes.

Mur-Artal, Montiel and Tardos, "ORB-SLAM: a Versatile and Accurate Monocular SLAM System", 2015,
section V; Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py.initialization import DepthInitializer
from orbslam2py.local_mapping import LocalMapping
from orbslam2py.records import FloatArray, Reason, TrackingState
from orbslam2py.sensor import Sensor
from orbslam2py.timing import StageTimer

_log = logging.getLogger(__name__)

#: A map with so few keyframes is given up when tracking is lost, and a new one is begun.
_SMALL_MAP = 5


@dataclass(frozen=True)
class TrackingThresholds:
    """The limits of tracking; the defaults are the published system's."""

    motion_model_matches: int = 20
    """Fewest matches with the last frame; the search window is doubled once."""
    reference_matches: int = 15
    """Fewest matches with the reference keyframe."""
    map_matches: int = 10
    """Fewest inliers of the first pose estimate."""
    local_map_inliers: int = 30
    """Fewest inliers in the local map."""
    local_map_inliers_after_relocalization: int = 50
    """The same for the first second after a relocalization."""
    few_close_points: int = 100
    """With fewer close points tracked than this ..."""
    many_untracked_close_points: int = 70
    """... and more close points than this not in the map, a keyframe is needed."""
    keyframe_queue: int = 3
    """A busy mapper is given a keyframe only if fewer than this wait."""


@dataclass
class TrackingOutcome:
    """What tracking one frame gave."""

    state: TrackingState
    reason: Reason = Reason.NONE
    n_matches: int = 0
    n_inliers: int = 0
    is_keyframe: bool = False
    covariance: FloatArray | None = None
    reset_needed: bool = False


class Tracking:
    """State machine of the front end. Runs in the thread that delivers the images.

    Parameters
    ----------
    world : orbslam2py._core.Map
        The map, shared with the other workers.
    vocabulary : orbslam2py._core.Vocabulary
        Visual words for matching with keyframes.
    mapping : LocalMapping
        Takes the keyframes.
    sensor : Sensor
        Stereo or RGB-D.
    max_frames : int
        Largest spacing of keyframes in frames: one second.
    thresholds : TrackingThresholds, optional
        Limits.
    """

    def __init__(
        self,
        world: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        sensor: Sensor,
        max_frames: int,
        thresholds: TrackingThresholds | None = None,
    ) -> None:
        self._map = world
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._sensor = sensor
        self._max_frames = max_frames
        self._limits = thresholds or TrackingThresholds()
        self._initializer = DepthInitializer(world, vocabulary, mapping)
        #: How often tracking was found again, over all maps.
        self.n_relocalizations = 0
        self.reset()

    def reset(self) -> None:
        """Forget the map's past; the map itself is cleared by the system."""
        self.state = TrackingState.NO_IMAGES_YET
        self.reference_keyframe = -1
        self._last: core.TrackedFrame | None = None
        self._last_tracked = False
        self._last_T_cr: core.Pose | None = None
        self._velocity: core.Pose | None = None
        self._last_keyframe_frame_id = 0
        # 0 acts as "relocalized at the first frame": a young map has to prove itself.
        self._last_relocalization_frame_id = 0

    # ---- one image -------------------------------------------------------------------------------
    def track(self, frame: core.TrackedFrame, timer: StageTimer) -> TrackingOutcome:
        """Find the frame's pose; make it a keyframe if the map needs one.

        On return the frame holds pose and associations if the outcome's state is OK; otherwise its
        pose is None.
        """
        if self.state == TrackingState.NO_IMAGES_YET:
            self.state = TrackingState.NOT_INITIALIZED
        if self.state == TrackingState.NOT_INITIALIZED:
            return self._initialize(frame, timer)

        outcome = TrackingOutcome(TrackingState.LOST)
        discarded = self._predict_pose(frame, outcome, timer)
        if discarded is not None:
            frame.reference_keyframe = self.reference_keyframe
            with timer("local_map"):
                self._track_local_map(frame, discarded, outcome)
        if outcome.reason is not Reason.NONE:
            return self._lose(frame, outcome)

        if self.state == TrackingState.LOST:
            self._last_relocalization_frame_id = frame.id
            self.n_relocalizations += 1
        self.state = outcome.state = TrackingState.OK
        self._update_velocity(frame)
        with timer("keyframe"):
            if self._needs_keyframe(frame, outcome.n_inliers):
                self._create_keyframe(frame)
                outcome.is_keyframe = True
        # Outliers went into the keyframe, where bundle adjustment decides about them; the next
        # frame must not start from them.
        frame.discard_outliers()
        self._remember(frame, tracked=True)
        return outcome

    def _initialize(self, frame: core.TrackedFrame, timer: StageTimer) -> TrackingOutcome:
        with timer("keyframe"):
            reason = self._initializer.try_initialize(frame)
        if reason is not Reason.NONE:
            return TrackingOutcome(TrackingState.NOT_INITIALIZED, reason)
        self.state = TrackingState.OK
        self.reference_keyframe = frame.reference_keyframe
        self._last_keyframe_frame_id = frame.id
        self._remember(frame, tracked=True)
        n = frame.n_associated()
        return TrackingOutcome(
            TrackingState.OK,
            n_matches=n,
            n_inliers=n,
            is_keyframe=True,
            covariance=np.zeros((6, 6)),
        )

    def _lose(self, frame: core.TrackedFrame, outcome: TrackingOutcome) -> TrackingOutcome:
        if self.state == TrackingState.OK:
            _log.info("tracking lost at frame %d: %s", frame.id, outcome.reason)
        self.state = outcome.state = TrackingState.LOST
        self._velocity = None
        frame.clear_associations()
        frame.T_cw = None
        outcome.reset_needed = self._map.n_keyframes <= _SMALL_MAP
        # The last pose stays where tracking was lost: the reference keyframe is tried from there.
        self._last_tracked = False
        return outcome

    def _remember(self, frame: core.TrackedFrame, *, tracked: bool) -> None:
        assert frame.T_cw is not None
        self._last = frame
        self._last_tracked = tracked
        self._last_T_cr = frame.T_cw @ self._map.keyframe_pose(frame.reference_keyframe).inverse()

    # ---- first estimate of the pose --------------------------------------------------------------
    def _predict_pose(
        self, frame: core.TrackedFrame, outcome: TrackingOutcome, timer: StageTimer
    ) -> npt.NDArray[np.int64] | None:
        """First pose from the last frame or the reference keyframe.

        Returns
        -------
        array of int64 or None
            Ids of the points that were matched and thrown out as outliers, ascending; None when
            no pose was found.
        """
        with timer("predict"):
            last, T_lw = self._update_last_frame()
            just_relocalized = frame.id < self._last_relocalization_frame_id + 2
            discarded = None
            if self._velocity is not None and not just_relocalized:
                frame.T_cw = self._velocity @ T_lw
                discarded = self._track_with_motion_model(frame, last, outcome)
            if discarded is None:
                frame.T_cw = T_lw
                discarded = self._track_reference_keyframe(frame, outcome)
        return discarded

    def _update_last_frame(self) -> tuple[core.TrackedFrame, core.Pose]:
        """Express the last frame by its reference keyframe, which mapping may have moved."""
        assert self._last is not None and self._last_T_cr is not None
        T_lw = self._last_T_cr @ self._map.keyframe_pose(self._last.reference_keyframe)
        self._last.T_cw = T_lw
        return self._last, T_lw

    def _track_with_motion_model(
        self, frame: core.TrackedFrame, last: core.TrackedFrame, outcome: TrackingOutcome
    ) -> npt.NDArray[np.int64] | None:
        core.refresh_associations(self._map, last)
        points = core.gather_points(self._map, last.map_points)
        stereo = self._sensor is Sensor.STEREO
        radius = 7.0 if stereo else 15.0
        for window in (radius, 2.0 * radius):
            frame.clear_associations()
            outcome.n_matches = core.match_last_frame(
                frame, last, points, window, self._sensor.has_depth
            )
            if outcome.n_matches >= self._limits.motion_model_matches:
                break
        else:
            outcome.reason = Reason.FEW_MATCHES_LAST_FRAME
            return None
        return self._estimate_pose(frame, outcome, Reason.FEW_MATCHES_LAST_FRAME)

    def _track_reference_keyframe(
        self, frame: core.TrackedFrame, outcome: TrackingOutcome
    ) -> npt.NDArray[np.int64] | None:
        core.describe(frame.frame, self._vocabulary)
        outcome.n_matches = core.match_keyframe_by_words(
            self._map, self.reference_keyframe, frame, 0.7
        )
        if outcome.n_matches < self._limits.reference_matches:
            outcome.reason = Reason.FEW_MATCHES_REFERENCE
            return None
        return self._estimate_pose(frame, outcome, Reason.FEW_INLIERS_REFERENCE)

    def _estimate_pose(
        self, frame: core.TrackedFrame, outcome: TrackingOutcome, reason: Reason
    ) -> npt.NDArray[np.int64] | None:
        estimate = core.optimize_pose(frame)
        outcome.n_inliers = estimate.n_inliers
        outcome.covariance = estimate.covariance
        discarded = frame.discard_outliers()
        if estimate.n_inliers < self._limits.map_matches:
            outcome.reason = reason
            return None
        outcome.reason = Reason.NONE
        return discarded

    # ---- local map -------------------------------------------------------------------------------
    def _track_local_map(
        self,
        frame: core.TrackedFrame,
        discarded: npt.NDArray[np.int64],
        outcome: TrackingOutcome,
    ) -> None:
        local_map = core.select_local_map(self._map, frame)
        if local_map.reference_keyframe >= 0:
            self.reference_keyframe = local_map.reference_keyframe
            frame.reference_keyframe = local_map.reference_keyframe
        radius_factor = 3.0 if self._sensor is Sensor.RGBD else 1.0
        if frame.id < self._last_relocalization_frame_id + 2:
            radius_factor = 5.0
        matches = core.match_local_map(frame, local_map.points, discarded, radius_factor)
        outcome.n_matches = frame.n_associated()
        estimate = core.optimize_pose(frame)
        outcome.covariance = estimate.covariance
        outcome.n_inliers = estimate.n_inliers
        core.count_sightings(self._map, frame, matches.visible)
        if self._sensor is Sensor.STEREO:
            frame.discard_outliers()

        recently_relocalized = frame.id < self._last_relocalization_frame_id + self._max_frames
        needed = self._limits.local_map_inliers
        if recently_relocalized:
            needed = self._limits.local_map_inliers_after_relocalization
        if outcome.n_inliers < needed:
            outcome.reason = Reason.FEW_INLIERS_LOCAL_MAP

    def _update_velocity(self, frame: core.TrackedFrame) -> None:
        last = self._last
        consecutive = last is not None and self._last_tracked and frame.id == last.id + 1
        if consecutive and last is not None and last.T_cw is not None and frame.T_cw is not None:
            self._velocity = frame.T_cw @ last.T_cw.inverse()
        else:
            self._velocity = None

    # ---- keyframes -------------------------------------------------------------------------------
    def _needs_keyframe(self, frame: core.TrackedFrame, n_inliers: int) -> bool:
        n_keyframes = self._map.n_keyframes
        if self._mapping.worker.pausing:
            return False
        recently_relocalized = frame.id < self._last_relocalization_frame_id + self._max_frames
        if recently_relocalized and n_keyframes > self._max_frames:
            return False

        min_observations = 2 if n_keyframes <= 2 else 3
        n_reference = core.count_tracked_points(
            self._map, self.reference_keyframe, min_observations
        )
        tracked_close, untracked_close = frame.n_close_tracked_untracked()
        needs_close_points = (
            tracked_close < self._limits.few_close_points
            and untracked_close > self._limits.many_untracked_close_points
        )
        idle = self._mapping.worker.idle
        ratio = 0.4 if n_keyframes < 2 else 0.75

        one_second_passed = frame.id >= self._last_keyframe_frame_id + self._max_frames
        tracking_is_weak = n_inliers < 0.25 * n_reference or needs_close_points
        sees_new_things = n_inliers < ratio * n_reference or needs_close_points
        wanted = (one_second_passed or idle or tracking_is_weak) and (
            sees_new_things and n_inliers > self._limits.reference_matches
        )
        if not wanted or idle:
            return wanted
        self._mapping.worker.interrupt()
        return self._mapping.worker.n_waiting < self._limits.keyframe_queue

    def _create_keyframe(self, frame: core.TrackedFrame) -> None:
        core.describe(frame.frame, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=self._sensor.has_depth)
        frame.reference_keyframe = self.reference_keyframe = keyframe
        self._last_keyframe_frame_id = frame.id
        self._mapping.insert_keyframe(keyframe)
