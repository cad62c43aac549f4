# SPDX-License-Identifier: BSD-3-Clause
"""Tracking: the pose of every image, and the choice of keyframes.

Mur-Artal, Montiel and Tardos, "ORB-SLAM: a Versatile and Accurate Monocular SLAM System", 2015,
section V; Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III. Step by step:
``docs/method/tracking.md``.
"""

from __future__ import annotations

import logging

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py._timing import StageTimer
from orbslam2py._values import replace
from orbslam2py.slam.acceptance.pose_acceptance import PoseAcceptance
from orbslam2py.slam.config import Config
from orbslam2py.slam.followed_frames import FollowedFrames
from orbslam2py.slam.inertial import ImuInterval, InertialTracker
from orbslam2py.slam.initialization import Initializer
from orbslam2py.slam.keyframe_decision import KeyframeDecision
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.pose_search import (
    PoseSearch,
    estimate_in_fixed_map,
    estimate_in_growing_map,
)
from orbslam2py.slam.records import (
    PoseEstimate,
    PoseMethod,
    Reason,
    TrackingResult,
    TrackingState,
)
from orbslam2py.slam.state import Motion, State
from orbslam2py.slam.state.transitions import (
    ActivateMap,
    Event,
    KeyframeInserted,
    MapBegun,
    MapDropped,
    MapLoaded,
    NotFound,
    NotInitialized,
    Relocalized,
    RestartInitializer,
    SearchForMap,
    Tracked,
    Transitions,
)
from orbslam2py.slam.watched_frame import accepted_keypoints

_log = logging.getLogger(__name__)


class Tracking:
    """State machine of the front end. Runs in the thread that delivers the images.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map, shared with the other workers.
    vocabulary : orbslam2py._core.Vocabulary
        Vocabulary for new keyframes.
    mapping : LocalMapping
        Takes the keyframes.
    initializer : Initializer
        The initializer.
    search : PoseSearch
        Estimates poses.
    acceptance : PoseAcceptance
        Validates poses.
    keyframe_decision : KeyframeDecision
        The decision whether a frame becomes a keyframe.
    config : Config
        Thresholds.
    has_depth : bool
        Whether frames measure depths; a keyframe makes map points of them.
    new_map_after : float or None
        Seconds that tracking is lost before another map begins beside those there are; None: only
        the old one is searched, for ever.
    inertial : InertialTracker or None
        Predicts poses by an IMU.
    followed : FollowedFrames or None
        Tracks frames without features.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        *,
        initializer: Initializer,
        search: PoseSearch,
        acceptance: PoseAcceptance,
        keyframe_decision: KeyframeDecision,
        config: Config,
        has_depth: bool,
        new_map_after: float | None = None,
        inertial: InertialTracker | None = None,
        followed: FollowedFrames | None = None,
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._initializer = initializer
        self._search = search
        self._acceptance = acceptance
        self._keyframe_decision = keyframe_decision
        self._has_depth = has_depth
        self._inertial = inertial
        self._followed = followed
        self._transitions = Transitions(config, new_map_after=new_map_after)
        self._state = State()

    # ---- maps that begin and end -----------------------------------------------------------------
    def restart(self) -> None:
        """Forget a failed map, but keep the frames that a new one may begin from."""
        frames = self._initializer.remembered()
        self._begin_anew()
        if frames:
            # The count of the frames continues, and the next map is new as well.
            self._state = self._state.map_begun(frames[-1].id)
        self._initializer.restart(frames)

    def reset(self) -> None:
        """Forget all frames of the map; the pipeline clears the map itself."""
        self._begin_anew()
        self._initializer.reset()

    def _begin_anew(self) -> None:
        self._state = State(n_relocalizations=self._state.n_relocalizations)

    def begin_in_loaded_map(self, initial_pose: core.Pose | None) -> None:
        """Start lost in the present map: every image is searched in it, and it is kept.

        Parameters
        ----------
        initial_pose : Pose or None
            ``T_cw`` of a likely pose; tried first.
        """
        maps = frozenset(self._map.maps)
        self._apply(MapLoaded(maps, initial_pose, self._keyframe_decision.spacing))

    def go_back(self) -> None:
        """Continue lost in the remaining maps: the map that began beside them was dropped."""
        frames = self._initializer.remembered()
        self._apply(MapDropped())
        self._initializer.restart(frames)

    def _apply(self, event: Event) -> None:
        """Replace the state, and carry out the actions of the event."""
        self._state, actions = self._transitions.next_state(self._state, event)
        for action in actions:
            match action:
                case RestartInitializer():
                    self._initializer.restart([])
                case ActivateMap():
                    found_in = self._map.activate_map_of(action.keyframe)
                    _log.info("found again at frame %d in map %d", action.frame_id, found_in)

    # ---- what others ask -------------------------------------------------------------------------
    @property
    def state(self) -> TrackingState:
        """Not initialized, tracked, or lost."""
        return self._state.phase

    @property
    def n_relocalizations(self) -> int:
        """Number of relocalizations, over all maps."""
        return self._state.n_relocalizations

    def feature_factor(self, *, localize: bool) -> int:
        """Factor on the number of features in the settings, for a single camera's next image.

        In localization mode no other thread needs the processor, and more features match more of
        the map. The same holds for a camera that is lost, or nearly lost. But more features are
        harder to distinguish for a lost camera, so it gets them in every second image.
        """
        state = self._state
        if state.initializing or state.seeks_map:
            return self._initializer.feature_factor
        if state.phase is TrackingState.OK:
            more = localize or state.is_scarce
        else:
            more = state.n_lost % 2 == 1
        return self._search.limits.feature_factor if more else 1

    @property
    def motion(self) -> Motion:
        """The last frame with a pose, and the velocity."""
        return self._state.motion

    @property
    def reference_keyframe(self) -> int:
        """The keyframe that shares most points with the last tracked frame, -1 for none."""
        return self._state.reference_keyframe

    @property
    def local_points(self) -> IntArray:
        """Ids (n,) of the points that the last refined frame was matched with."""
        local_map = self._state.local_map
        return np.zeros(0, np.int64) if local_map is None else local_map.points.ids

    @property
    def start_lines(self) -> FloatArray | None:
        """See `Initializer.lines` while a single camera's map begins; otherwise None."""
        return self._initializer.lines() if self._state.initializing else None

    # ---- one image -------------------------------------------------------------------------------
    def track(
        self,
        frame: core.TrackedFrame,
        timer: StageTimer,
        *,
        localize: bool = False,
        details: bool = False,
        interval: ImuInterval | None = None,
    ) -> TrackingResult:
        """Estimate the frame's pose; make it a keyframe if the map needs one.

        After the call the frame has pose and associations if the outcome's state is OK; otherwise
        its pose is None.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        timer : StageTimer
            Measures the time of each step.
        localize : bool
            Pose only: no keyframes, no new points.
        details : bool
            The result also contains the keypoints that the pose was accepted with.
        interval : ImuInterval or None
            Samples of the IMU since the frame before.
        """
        result = self._track(frame, timer, localize=localize, details=details, interval=interval)
        if self._followed is not None:
            ok = result.state is TrackingState.OK and not result.estimate.unconfirmed
            self._followed.note(frame if ok else None)
        return result

    def _track(
        self,
        frame: core.TrackedFrame,
        timer: StageTimer,
        *,
        localize: bool,
        details: bool,
        interval: ImuInterval | None,
    ) -> TrackingResult:
        if self._inertial is not None:
            self._state = self._inertial.predict(interval, self._state, frame.timestamp)
        if self._state.initializing:
            self._apply(NotInitialized())
            return self._begin_map(frame, timer)
        if self._is_small and not self._state.seeks_map:
            self._initializer.remember(frame)
        estimate = self._find_pose(frame, timer, localize)
        if estimate.found and self._transitions.is_contradicted(self._state, frame):
            estimate = estimate.failed(Reason.NOT_CONFIRMED)
        if self._inertial is not None and self._state.phase is TrackingState.OK:
            estimate = self._inertial.judge(frame, estimate, self._state.motion)
            if estimate.method is PoseMethod.IMU:
                return self._follow_imu(self._inertial, frame, estimate, localize=localize)
        if not estimate.found:
            begun = self._begin_map_beside(frame, timer, localize=localize)
            return begun or self._lose(frame, estimate)
        if self._state.is_lost or estimate.unconfirmed:
            estimate = replace(estimate, unconfirmed=True)
            self._apply(Relocalized(frame, estimate.n_inliers))
        else:
            self._apply(Tracked(frame, estimate.n_inliers, self._map.active_map))
        if self._inertial is not None:
            self._inertial.tracked(frame, estimate)
        # Computed before temporary points are dropped and keypoints of a keyframe become points.
        inliers = accepted_keypoints(frame) if details else None
        is_keyframe = False
        if localize:
            core.discard_temporary(frame)
            self._state = replace(self._state, keyframe_candidate=None)
        else:
            with timer("keyframe"):
                is_keyframe = self._extend_map(frame, estimate)
        # Outliers went into the keyframe, where bundle adjustment decides about them; the next
        # frame must not start from them.
        frame.discard_outliers()
        return TrackingResult(self._state.phase, estimate, is_keyframe, inliers=inliers)

    def follow(
        self,
        image: ByteArray,
        depth: ByteArray | None,
        frame_id: int,
        timestamp: float,
        *,
        details: bool,
    ) -> tuple[core.TrackedFrame, TrackingResult] | None:
        """Track an image without features by the patches of known points.

        The frame becomes no keyframe.

        Parameters
        ----------
        image, depth
            Of the frame; no depth with a single camera.
        frame_id, timestamp
            Number and time [s] of the frame.
        details : bool
            The result also contains the keypoints that the pose was accepted with.

        Returns
        -------
        tuple or None
            The frame with its pose, and what was found; None where the image needs features.
        """
        if self._followed is None:
            return None
        found = self._followed.follow(image, depth, frame_id, timestamp, self._state)
        if found is None:
            return None
        frame, estimate, self._state = found
        self._apply(Tracked(frame, estimate.n_inliers, self._map.active_map))
        inliers = accepted_keypoints(frame) if details else None
        return frame, TrackingResult(self._state.phase, estimate, inliers=inliers)

    def _follow_imu(
        self,
        inertial: InertialTracker,
        frame: core.TrackedFrame,
        estimate: PoseEstimate,
        *,
        localize: bool,
    ) -> TrackingResult:
        """Keep a pose that the IMU predicted; where the map does not reach, extend it.

        With depth the frame becomes a keyframe at this pose. A single camera is lost then, and
        begins another map as without an IMU.
        """
        if localize or not inertial.is_beyond_map(frame, self._initializer.shows_enough(frame)):
            return TrackingResult(self._state.phase, estimate)
        if not self._has_depth:
            inertial.end_of_map()
            return self._lose(frame, estimate.failed(Reason.WEAK_EVIDENCE))
        _log.info("the map continues at frame %d, where the IMU has led", frame.id)
        self._create_keyframe(frame)
        self._apply(Tracked(frame, frame.n_associated(), self._map.active_map))
        inertial.map_continued(frame)
        inertial.keyframe_made(self._state.since_keyframe.keyframe, frame)
        return TrackingResult(self._state.phase, estimate, is_keyframe=True)

    def _find_pose(
        self, frame: core.TrackedFrame, timer: StageTimer, localize: bool
    ) -> PoseEstimate:
        changes_before = self._map.big_change_index
        if localize:
            kept = self._state.kept_maps | {self._map.active_map}
            self._state = replace(self._state, kept_maps=kept)
        estimate, state = self._search_once(frame, self._state, timer, localize)
        if not estimate.found and self._map.big_change_index != changes_before:
            # A loop was closed in between: some matches may be with the old map.
            frame.clear_associations()
            estimate, state = self._search_once(frame, state, timer, localize)
        self._state = state
        return estimate

    def _search_once(
        self, frame: core.TrackedFrame, state: State, timer: StageTimer, localize: bool
    ) -> tuple[PoseEstimate, State]:
        lost = state.is_lost
        estimate_first = estimate_in_fixed_map if localize else estimate_in_growing_map
        with timer("predict"):
            first, state = estimate_first(self._search, frame, state)
        if lost and not first.found:
            return first, state
        if lost or first.relocalized:
            state = state.relocalized(frame.id)
            since = replace(state.since_keyframe, most_inliers=0)
            state = replace(state, since_keyframe=since)
        with timer("local_map"):
            estimate, state = self._acceptance.refine(frame, first, state, fixed_map=localize)
        if estimate.found:
            state = replace(state, beyond_map=localize and estimate.visual_odometry)
        return estimate, state

    def _begin_map(self, frame: core.TrackedFrame, timer: StageTimer) -> TrackingResult:
        with timer("keyframe"):
            T_cw = None if self._inertial is None else self._inertial.pose_to_begin_at
            reason = self._initializer.try_initialize(frame, T_cw)
        if reason is Reason.NONE:
            if self._inertial is not None:
                self._inertial.map_begun(T_cw)
            return self._map_begun(frame)
        spoilt = self._map.active_map if reason is Reason.INITIAL_MAP_FAILED else None
        return TrackingResult(self._state.phase, PoseEstimate(reason), given_up=spoilt)

    def _begin_map_beside(
        self, frame: core.TrackedFrame, timer: StageTimer, *, localize: bool
    ) -> TrackingResult | None:
        """Begin another map with a frame that was not found; return None if it is too early."""
        if localize or not self._transitions.may_begin_map(self._state, frame.timestamp):
            return None
        self._apply(SearchForMap())
        frame.clear_associations()
        begun = self._begin_map(frame, timer)
        return begun if begun.estimate.found or begun.given_up is not None else None

    def _map_begun(self, frame: core.TrackedFrame) -> TrackingResult:
        earlier = self._initializer.take_earlier()
        self._apply(MapBegun(frame, earlier))
        n = frame.n_associated()
        # Its pose is the origin, but its keypoints, which became points, have errors.
        covariance = core.pose_covariance(frame)
        estimate = PoseEstimate(n_matches=n, n_inliers=n, covariance=covariance)
        return TrackingResult(
            self._state.phase, estimate, is_keyframe=True, earlier=earlier, begins_map=True
        )

    def _lose(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> TrackingResult:
        if not self._state.is_lost:
            _log.info("tracking lost at frame %d: %s", frame.id, estimate.reason)
        since = frame.timestamp
        if self._inertial is not None and self._inertial.is_adrift:
            since = self._inertial.last_seen  # the images showed nothing from then on
        self._apply(NotFound(since))
        frame.clear_associations()
        frame.T_cw = None
        # A map that was loaded, or used for localization, is the user's, however small.
        active = self._map.active_map
        small = self._is_small and active not in self._state.kept_maps
        # Other maps are dropped for one that begins. Under a hand none does, and the camera may be
        # found behind it.
        another = self._initializer.shows_enough(frame)
        given_up = active if small and another else None
        return TrackingResult(self._state.phase, estimate, given_up=given_up)

    @property
    def _is_small(self) -> bool:
        """Return whether the map is dropped if tracking is lost."""
        n_keyframes = self._map.n_active_keyframes - self._initializer.n_between()
        return bool(n_keyframes <= self._search.limits.small_map)

    # ---- keyframes -------------------------------------------------------------------------------
    def _extend_map(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> bool:
        """Make a tracked frame a keyframe if the map needs one; return whether it did."""
        candidate = self._state.keyframe_candidate
        self._state = replace(self._state, keyframe_candidate=None)
        if candidate is not None:
            # The relocalized frame is confirmed now. At the border of the map, it sees more of the
            # map than later frames.
            self._create_keyframe(candidate)
        allowed, self._state = self._acceptance.allows_keyframe(estimate.evidence, self._state)
        if not (allowed and self._keyframe_wanted(frame, estimate)):
            return False
        if estimate.unconfirmed:
            self._state = replace(self._state, keyframe_candidate=frame)
            return False
        if estimate.evidence is not None and estimate.evidence.doubted:
            # Bundle adjustment checks them again, but would have few inliers for that.
            frame.discard_outliers()
        self._create_keyframe(frame)
        if self._inertial is not None:
            self._inertial.keyframe_made(self._state.since_keyframe.keyframe, frame)
        return True

    def _keyframe_wanted(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> bool:
        state = self._state
        since = state.since_keyframe.saw(estimate.n_inliers)
        self._state = replace(state, since_keyframe=since)
        return self._keyframe_decision.wanted(
            frame, state.reference_keyframe, estimate.n_inliers, state.motion.velocity, since
        )

    def _create_keyframe(self, frame: core.TrackedFrame) -> None:
        core.describe(frame.features, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=self._has_depth)
        self._apply(KeyframeInserted(frame.id, keyframe))
        self._mapping.insert_keyframe(keyframe)
