# SPDX-License-Identifier: BSD-3-Clause
"""Tracking: the pose of every image, and which images become keyframes.

Mur-Artal, Montiel and Tardos, "ORB-SLAM: a Versatile and Accurate Monocular SLAM System", 2015,
section V; Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III.
"""

from __future__ import annotations

import logging

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.initialization import DepthInitializer
from orbslam2py.slam.keyframe_decision import KeyframeClock, KeyframeDecision
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.monocular_initialization import MonocularInitializer
from orbslam2py.slam.records import Reason, TrackingState
from orbslam2py.slam.relocalization import Relocalizer
from orbslam2py.slam.timing import StageTimer
from orbslam2py.slam.tracking_types import TrackingOutcome, TrackingThresholds

_log = logging.getLogger(__name__)

#: A map with so few keyframes is given up when tracking is lost, and a new one is begun.
_SMALL_MAP = 5

#: No point was thrown out.
_NOTHING = np.zeros(0, np.int64)


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
        What the images come from.
    max_frames : int
        Largest spacing of keyframes in frames: one second.
    initializer : DepthInitializer or MonocularInitializer, optional
        How a map begins; `DepthInitializer` if None.
    relocalizer : Relocalizer, optional
        Finds lost frames in the map; without it only the reference keyframe is tried.
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
        *,
        initializer: DepthInitializer | MonocularInitializer | None = None,
        relocalizer: Relocalizer | None = None,
        thresholds: TrackingThresholds | None = None,
    ) -> None:
        self._map = world
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._sensor = sensor
        self._max_frames = max_frames
        self._limits = thresholds or TrackingThresholds()
        self._keyframe_decision = KeyframeDecision(
            world, mapping.worker, sensor, max_frames, self._limits
        )
        self._initializer = initializer or DepthInitializer(world, vocabulary, mapping)
        self._relocalizer = relocalizer
        #: Pose only: no keyframes, no new points. A choice of the user, kept over resets.
        self.localization_only = False
        #: How often tracking was found again, over all maps.
        self.n_relocalizations = 0
        self.reset()

    def reset(self) -> None:
        """Forget the map's past; the map itself is cleared by the system."""
        self.state = TrackingState.NO_IMAGES_YET
        self.reference_keyframe = -1
        self._last: core.TrackedFrame | None = None
        self._last_tracked = False
        self._last_points = core.PointBatch()
        self._velocity: core.Pose | None = None
        self._last_keyframe_frame_id = 0
        # 0 acts as "relocalized at the first frame": a young map has to prove itself.
        self._last_relocalization_frame_id = 0
        # Whether localization mode has been on in this map.
        self._map_is_kept = False
        # In localization mode: the last frame hangs on its own depths more than on the map.
        self._visual_odometry = False
        self._initializer.reset()

    @property
    def initializing(self) -> bool:
        """Whether the next image may begin a map."""
        return self.state in (TrackingState.NO_IMAGES_YET, TrackingState.NOT_INITIALIZED)

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

        map_moves = self._map.big_change_index
        outcome = self._find_pose(frame, timer)
        if outcome.reason is not Reason.NONE and self._map.big_change_index != map_moves:
            # A loop was closed meanwhile: what was matched may be half of the old map.
            frame.clear_associations()
            outcome = self._find_pose(frame, timer)
        if outcome.reason is not Reason.NONE:
            return self._lose(frame, outcome)

        if self.state == TrackingState.LOST:
            self.n_relocalizations += 1
        self.state = outcome.state = TrackingState.OK
        outcome.visual_odometry = self._visual_odometry
        self._update_velocity(frame)
        if self.localization_only:
            core.discard_temporary(frame)
        else:
            with timer("keyframe"):
                since = KeyframeClock(
                    last_keyframe=self._last_keyframe_frame_id,
                    last_relocalization=self._last_relocalization_frame_id,
                )
                outcome.is_keyframe = self._keyframe_decision.wanted(
                    frame, self.reference_keyframe, outcome.n_inliers, since
                )
                if outcome.is_keyframe:
                    self._create_keyframe(frame)
        # Outliers went into the keyframe, where bundle adjustment decides about them; the next
        # frame must not start from them.
        frame.discard_outliers()
        self._remember(frame, tracked=True)
        return outcome

    def _find_pose(self, frame: core.TrackedFrame, timer: StageTimer) -> TrackingOutcome:
        outcome = TrackingOutcome(TrackingState.LOST)
        with timer("predict"):
            if self.localization_only:
                self._map_is_kept = True
                discarded = self._predict_pose_in_fixed_map(frame, outcome)
            else:
                discarded = self._predict_pose(frame, outcome)
        if discarded is not None:
            if self.state == TrackingState.LOST:
                self._last_relocalization_frame_id = frame.id
            if not self._visual_odometry:
                with timer("local_map"):
                    self._track_local_map(frame, discarded, outcome)
        return outcome

    def _initialize(self, frame: core.TrackedFrame, timer: StageTimer) -> TrackingOutcome:
        with timer("keyframe"):
            reason = self._initializer.try_initialize(frame)
        if reason is not Reason.NONE:
            spoilt = reason is Reason.INITIAL_MAP_FAILED
            return TrackingOutcome(TrackingState.NOT_INITIALIZED, reason, reset_needed=spoilt)
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
        # A map that was used for localization is the user's, however small.
        outcome.reset_needed = self._map.n_keyframes <= _SMALL_MAP and not self._map_is_kept
        self._visual_odometry = False
        # The last pose stays where tracking was lost: the reference keyframe is tried from there.
        self._last_tracked = False
        return outcome

    def _remember(self, frame: core.TrackedFrame, *, tracked: bool) -> None:
        assert frame.T_cw is not None
        self._last = frame
        self._last_tracked = tracked

    # ---- first estimate of the pose --------------------------------------------------------------
    def _predict_pose(
        self, frame: core.TrackedFrame, outcome: TrackingOutcome
    ) -> npt.NDArray[np.int64] | None:
        """First pose: by the motion model, the reference keyframe, or anywhere in the map.

        Returns
        -------
        array of int64 or None
            Ids of the points that were matched and thrown out as outliers, ascending; None when
            no pose was found.
        """
        self._visual_odometry = False
        if self.state == TrackingState.LOST and self._relocalize(frame, outcome):
            return _NOTHING
        last, T_lw = self._update_last_frame()
        just_relocalized = frame.id < self._last_relocalization_frame_id + 2
        discarded = None
        if self._velocity is not None and not just_relocalized:
            self._predict(frame, last, self._velocity @ T_lw)
            discarded = self._track_with_motion_model(frame, last, outcome)
        if discarded is None:
            self._predict(frame, last, T_lw)
            discarded = self._track_reference_keyframe(frame, outcome)
        if discarded is None and self.state == TrackingState.LOST:
            outcome.reason = Reason.NOT_FOUND_IN_MAP
        return discarded

    def _predict_pose_in_fixed_map(
        self, frame: core.TrackedFrame, outcome: TrackingOutcome
    ) -> npt.NDArray[np.int64] | None:
        """First pose in localization mode, where the map may end.

        Where it does, the pose hangs on the depths of the frame before (visual odometry), while
        every frame is also searched in the map.
        """
        if self.state == TrackingState.LOST:
            return _NOTHING if self._relocalize(frame, outcome) else None
        last, T_lw = self._update_last_frame()
        if self._visual_odometry:
            return self._follow_visual_odometry(frame, last, T_lw, outcome)
        if self._velocity is not None:
            self._predict(frame, last, self._velocity @ T_lw)
            return self._track_with_motion_model(frame, last, outcome)
        self._predict(frame, last, T_lw)
        return self._track_reference_keyframe(frame, outcome)

    def _follow_visual_odometry(
        self,
        frame: core.TrackedFrame,
        last: core.TrackedFrame,
        T_lw: core.Pose,
        outcome: TrackingOutcome,
    ) -> npt.NDArray[np.int64] | None:
        discarded = None
        if self._velocity is not None:
            self._predict(frame, last, self._velocity @ T_lw)
            discarded = self._track_with_motion_model(frame, last, outcome)
        if not self._visual_odometry:  # enough of the map is in view again
            return discarded
        found = core.TrackedFrame(frame.frame)
        kept = outcome.reason, outcome.n_matches, outcome.n_inliers
        if self._relocalize(found, outcome):
            # The odometry's drift ends here and is no motion: the last frame moves along.
            if discarded is not None and frame.T_cw is not None and found.T_cw is not None:
                last.T_cw = T_lw @ frame.T_cw.inverse() @ found.T_cw
            else:
                self._last_tracked = False
            frame.copy_associations(found, np.ones(len(frame.frame), bool))
            self._predict(frame, found, found.T_cw)
            self._visual_odometry = False
            self._last_relocalization_frame_id = frame.id
            return _NOTHING
        outcome.reason, outcome.n_matches, outcome.n_inliers = kept
        return discarded

    def _relocalize(self, frame: core.TrackedFrame, outcome: TrackingOutcome) -> bool:
        if self._relocalizer is None:
            return False
        core.describe(frame.frame, self._vocabulary)
        outcome.n_inliers = outcome.n_matches = self._relocalizer.relocalize(frame)
        outcome.reason = Reason.NONE if outcome.n_inliers else Reason.NOT_FOUND_IN_MAP
        if outcome.n_inliers == 0:
            return False
        core.anchor_frame(self._map, frame, self.reference_keyframe)
        return True

    @staticmethod
    def _predict(
        frame: core.TrackedFrame, source: core.TrackedFrame, T_cw: core.Pose | None
    ) -> None:
        """Set a pose that follows from another frame's, and with it from the same map."""
        frame.T_cw = T_cw
        frame.share_anchor(source)

    def _update_last_frame(self) -> tuple[core.TrackedFrame, core.Pose]:
        """Bring the last frame up to date with the map, which mapping and loop closing move."""
        last = self._last
        assert last is not None
        self._last_points, stretched = core.follow_map(self._map, last)
        if self._velocity is not None and stretched != 1.0:
            # A single camera's loop took out a drift of scale, in which the speed was measured.
            self._velocity = core.Pose(
                self._velocity.quaternion_xyzw, stretched * self._velocity.translation
            )
        self.reference_keyframe = self._map.living(self.reference_keyframe)
        assert last.T_cw is not None
        return last, last.T_cw

    def _track_with_motion_model(
        self, frame: core.TrackedFrame, last: core.TrackedFrame, outcome: TrackingOutcome
    ) -> npt.NDArray[np.int64] | None:
        points = self._last_points
        if self.localization_only and self._sensor.has_depth:
            core.add_temporary_points(last, points)
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
        if not self.localization_only:
            return self._estimate_pose(frame, outcome, Reason.FEW_MATCHES_LAST_FRAME)
        discarded = self._estimate_pose(frame, outcome, Reason.FEW_MATCHES_LAST_FRAME)
        if discarded is None or outcome.n_inliers <= self._limits.localization_matches:
            outcome.reason = Reason.FEW_MATCHES_LAST_FRAME
            return None
        self._visual_odometry = core.count_map_points(frame) < self._limits.map_matches
        return discarded

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
        consecutive = (
            last is not None
            and self._last_tracked
            and frame.id == last.id + 1
            and frame.big_change == last.big_change
        )
        if consecutive and last is not None and last.T_cw is not None and frame.T_cw is not None:
            self._velocity = frame.T_cw @ last.T_cw.inverse()
        else:
            self._velocity = None

    # ---- keyframes -------------------------------------------------------------------------------
    def _create_keyframe(self, frame: core.TrackedFrame) -> None:
        core.describe(frame.frame, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=self._sensor.has_depth)
        self.reference_keyframe = keyframe
        self._last_keyframe_frame_id = frame.id
        self._mapping.insert_keyframe(keyframe)
