# SPDX-License-Identifier: BSD-3-Clause
"""Tracking: the pose of every image, and which images become keyframes.

Mur-Artal, Montiel and Tardos, "ORB-SLAM: a Versatile and Accurate Monocular SLAM System", 2015,
section V; Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III. Step by step:
``docs/method/tracking.md``.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._timing import StageTimer
from orbslam2py.slam.acceptance.pose_acceptance import PoseAcceptance
from orbslam2py.slam.config import Config
from orbslam2py.slam.initialization import Initializer
from orbslam2py.slam.keyframe_decision import KeyframeDecision, SinceKeyframe
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.pose_search import (
    FirstEstimate,
    FirstEstimateInFixedMap,
    FirstEstimateInGrowingMap,
    MotionModel,
    PoseSearch,
)
from orbslam2py.slam.records import PoseEstimate, Reason, TrackingResult, TrackingState
from orbslam2py.slam.relocalization import Confirmation, LostTimer
from orbslam2py.slam.watched_frame import accepted_keypoints

_log = logging.getLogger(__name__)


class Tracking:
    """State machine of the front end. Runs in the thread that delivers the images.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map, shared with the other workers.
    vocabulary : orbslam2py._core.Vocabulary
        Visual words of new keyframes.
    mapping : LocalMapping
        Takes the keyframes.
    initializer : Initializer
        How a map begins.
    search : PoseSearch
        The ways to a pose.
    acceptance : PoseAcceptance
        Whether enough speaks for a pose.
    keyframe_decision : KeyframeDecision
        Which frames become keyframes.
    config : Config
        Thresholds.
    has_depth : bool
        Whether frames measure depths, which become points of the map with a keyframe.
    new_map_after : float or None
        Seconds that tracking is lost before another map begins beside those there are; None: only
        the old one is searched, for ever.
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
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._initializer = initializer
        self._search = search
        self._acceptance = acceptance
        self._keyframe_decision = keyframe_decision
        self._has_depth = has_depth
        self._in_growing_map = FirstEstimateInGrowingMap(search)
        self._in_fixed_map = FirstEstimateInFixedMap(search, has_depth=has_depth)
        self._confirmation = Confirmation(config.relocalization)
        self._loss = LostTimer(new_map_after)
        #: How often tracking was found again, over all maps.
        self.n_relocalizations = 0
        self.reset()

    def restart(self) -> None:
        """Forget a map that came to nothing, but not the frames that a new one may begin from."""
        frames = self._initializer.remembered()
        self._forget_maps()
        if frames:
            # The count of the frames goes on, and the next map is young as well.
            self._search.proving.map_begun(frames[-1].id)
        self._initializer.restart(frames)

    def reset(self) -> None:
        """Forget the map's past; the map itself is cleared by the pipeline."""
        self._forget_maps()
        self._initializer.reset()

    def _forget_maps(self) -> None:
        self.state = TrackingState.NO_IMAGES_YET
        self._since_keyframe = SinceKeyframe()
        # Maps that were loaded, and those that localization mode has been on in.
        self._kept_maps: set[int] = set()
        # Whether the initializer is shown the frames of a loss.
        self._seeks_map = False
        self._search.reset()
        self._acceptance.reset()
        self._in_fixed_map.reset()
        self._confirmation.reset()
        # A frame found again that becomes a keyframe with the next one.
        self._waits_for_confirmation: core.TrackedFrame | None = None
        self._loss.reset()
        # Images in a row without a pose.
        self._n_lost = 0
        # Whether the last pose hangs on few points; unknown of a map's first one.
        self._is_scarce = False

    def begin_in_loaded_map(self, initial_pose: core.Pose | None) -> None:
        """Start lost in the map as it is: every image is searched in it, and it is kept.

        Parameters
        ----------
        initial_pose : Pose or None
            ``T_cw`` where the camera may be; tried before all else.
        """
        self.state = TrackingState.LOST
        self._kept_maps = set(self._map.maps)
        # The map's keyframes are of another run: the first frame found may be one already.
        self._since_keyframe = SinceKeyframe(-self._keyframe_decision.spacing)
        self._search.initial_pose = initial_pose
        self._search.searches_loaded_map = True

    def go_back(self) -> None:
        """Be lost in the maps that are left: the one that had begun beside them was dropped."""
        frames = self._initializer.remembered()
        self._leave_map()
        self.state = TrackingState.LOST
        # The next image that can begin a map does.
        self._loss.be_overdue()
        self._seeks_map = True
        self._initializer.restart(frames)

    def _leave_map(self) -> None:
        """Forget the frames before: what follows is in another map."""
        self._search.reset()
        self._acceptance.go_elsewhere()
        self._in_fixed_map.reset()
        self._confirmation.reset()
        self._waits_for_confirmation = None

    @property
    def initializing(self) -> bool:
        """Whether the next image may begin a map."""
        return self.state in (TrackingState.NO_IMAGES_YET, TrackingState.NOT_INITIALIZED)

    def feature_factor(self, *, localize: bool) -> int:
        """Features that a single camera's next image needs, in multiples of the settings'.

        In localization mode nobody else needs the time, and more features find more of the map; so
        they do for a camera that is lost, or about to be. But they are harder to tell apart for a
        lost one, and take turns.
        """
        if self.initializing or self._seeks_map:
            return self._initializer.feature_factor
        if self.state is TrackingState.OK:
            more = localize or self._is_scarce
        else:
            more = self._n_lost % 2 == 1
        return self._search.limits.feature_factor if more else 1

    @property
    def motion(self) -> MotionModel:
        """The last frame that had a pose, and the speed."""
        return self._search.motion

    @property
    def reference_keyframe(self) -> int:
        """The keyframe that shares most points with the last tracked frame, -1 for none."""
        return self._search.reference_keyframe

    @property
    def local_points(self) -> IntArray:
        """Ids (n,) of the points that the last refined frame was matched with."""
        local_map = self._search.local_map
        return np.zeros(0, np.int64) if local_map is None else local_map.points.ids

    @property
    def start_lines(self) -> FloatArray | None:
        """While a single camera's map begins: see `Initializer.lines`; else None."""
        return self._initializer.lines() if self.initializing else None

    # ---- one image -------------------------------------------------------------------------------
    def track(
        self,
        frame: core.TrackedFrame,
        timer: StageTimer,
        *,
        localize: bool = False,
        details: bool = False,
    ) -> TrackingResult:
        """Find the frame's pose; make it a keyframe if the map needs one.

        On return the frame holds pose and associations if the outcome's state is OK; otherwise its
        pose is None.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        timer : StageTimer
            Takes the time of each step.
        localize : bool
            Pose only: no keyframes, no new points.
        details : bool
            The outcome is to say which keypoints the pose was accepted with.
        """
        if self.initializing:
            return self._begin_map(frame, timer)
        young = self._is_small or self._initializer.watches_map
        if young and not self._seeks_map:
            self._initializer.remember(frame)
        estimate = self._find_pose(frame, timer, localize)
        if estimate.found:
            estimate = self._confirm(frame, estimate)
        if not estimate.found:
            begun = self._begin_map_beside(frame, timer, localize=localize)
            return begun or self._lose(frame, estimate)
        if not (localize or estimate.unconfirmed):
            with timer("keyframe"):
                wrong = self._wrong_map(frame)
            if wrong is not None:
                contradicted = estimate.failed(Reason.MAP_CONTRADICTED)
                return self._lose(frame, contradicted, wrong_map=wrong)

        self.state = TrackingState.OK
        if not estimate.unconfirmed:
            self._stay(frame)
        self._is_scarce = estimate.n_inliers < self._search.limits.scarce_inliers
        self._search.motion.update_velocity(frame)
        # Before temporary points go, and a keyframe's keypoints become points.
        inliers = accepted_keypoints(frame) if details else None
        is_keyframe = False
        if localize:
            core.discard_temporary(frame)
            self._waits_for_confirmation = None
        else:
            with timer("keyframe"):
                is_keyframe = self._extend_map(frame, estimate)
        # Outliers went into the keyframe, where bundle adjustment decides about them; the next
        # frame must not start from them.
        frame.discard_outliers()
        self._search.motion.remember(frame)
        return TrackingResult(self.state, estimate, is_keyframe, inliers=inliers)

    def _find_pose(
        self, frame: core.TrackedFrame, timer: StageTimer, localize: bool
    ) -> PoseEstimate:
        changes_before = self._map.big_change_index
        estimate = self._search_once(frame, timer, localize)
        if not estimate.found and self._map.big_change_index != changes_before:
            # A loop was closed meanwhile: what was matched may be half of the old map.
            frame.clear_associations()
            estimate = self._search_once(frame, timer, localize)
        return estimate

    def _search_once(
        self, frame: core.TrackedFrame, timer: StageTimer, localize: bool
    ) -> PoseEstimate:
        lost = self.state is TrackingState.LOST
        strategy: FirstEstimate = self._in_growing_map
        if localize:
            self._kept_maps.add(self._map.active_map)
            self._initializer.believe_map()
            strategy = self._in_fixed_map
        self._search.map_is_fixed = localize
        with timer("predict"):
            estimate = strategy.estimate(frame, lost=lost)
        if lost and not estimate.found:
            return estimate
        if lost or estimate.relocalized:
            self._search.proving.found_again(frame, where_expected=estimate.where_expected)
            self._since_keyframe.most_inliers = 0
        with timer("local_map"):
            believed = self._acceptance.refine(frame, estimate, lost=lost)
        if believed.found:
            strategy.believe(believed)
        return believed

    def _confirm(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> PoseEstimate:
        """A pose found again waits for the next frame; that one confirms it, or both are wrong."""
        confirmation = self._confirmation
        if self.state is TrackingState.LOST:
            self.n_relocalizations += 1
            self._search.initial_pose = None
            confirmation.found(frame)
            return replace(estimate, unconfirmed=True)
        if confirmation.waiting:
            if not confirmation.follows(frame):
                return estimate.failed(Reason.NOT_CONFIRMED)
            confirmation.reset()
            self._search.confirm()
        return estimate

    def _begin_map(self, frame: core.TrackedFrame, timer: StageTimer) -> TrackingResult:
        self.state = TrackingState.NOT_INITIALIZED
        with timer("keyframe"):
            reason = self._initializer.try_initialize(frame)
        if reason is not Reason.NONE:
            spoilt = reason is Reason.INITIAL_MAP_FAILED
            given_up = self._map.active_map if spoilt else None
            return TrackingResult(self.state, PoseEstimate(reason), given_up=given_up)
        return self._map_begun(frame)

    def _begin_map_beside(
        self, frame: core.TrackedFrame, timer: StageTimer, *, localize: bool
    ) -> TrackingResult | None:
        """Begin another map with a frame that is not found; None if the time has not come."""
        if self.state is not TrackingState.LOST or localize:
            return None
        if not self._loss.overdue(frame.timestamp):
            return None
        if not self._seeks_map:
            self._initializer.restart([])
            self._seeks_map = True
        frame.clear_associations()
        with timer("keyframe"):
            reason = self._initializer.try_initialize(frame)
        if reason is Reason.INITIAL_MAP_FAILED:
            spoilt = self._map.active_map
            return TrackingResult(self.state, PoseEstimate(reason), given_up=spoilt)
        if reason is not Reason.NONE:
            return None
        self._leave_map()
        # A young map has to prove itself.
        self._search.proving.map_begun(frame.id)
        self._seeks_map = False
        self._loss.reset()
        return self._map_begun(frame)

    def _map_begun(self, frame: core.TrackedFrame) -> TrackingResult:
        self.state = TrackingState.OK
        earlier = self._initializer.take_earlier()
        self._search.reference_keyframe = frame.reference_keyframe
        if earlier:
            # So the speed is known: a pose that is sought from where the camera was may stay there.
            self._search.motion.remember(earlier[-1])
            self._search.motion.update_velocity(frame)
        self._search.motion.remember(frame)
        self._since_keyframe = SinceKeyframe(frame.id, frame.reference_keyframe)
        n = frame.n_associated()
        # It is the origin, and yet lies in its map no better than the keypoints that became points.
        covariance = core.pose_covariance(frame)
        estimate = PoseEstimate(n_matches=n, n_inliers=n, covariance=covariance)
        return TrackingResult(self.state, estimate, is_keyframe=True, earlier=earlier)

    def _wrong_map(self, frame: core.TrackedFrame) -> int | None:
        """The number of a map that the images contradict by now."""
        there = frame.map_index
        contradicted = self._initializer.contradicts(frame)
        # While they were compared loop closing may have joined it to another map.
        return there if contradicted and self._map.active_map == there else None

    def _lose(
        self, frame: core.TrackedFrame, estimate: PoseEstimate, *, wrong_map: int | None = None
    ) -> TrackingResult:
        was_ok = self.state is TrackingState.OK
        self._loss.lost(frame.timestamp)
        self._n_lost += 1
        self._is_scarce = False
        if was_ok:
            _log.info("tracking lost at frame %d: %s", frame.id, estimate.reason)
        self.state = TrackingState.LOST
        # The last pose stays where tracking was lost: the reference keyframe is tried from there.
        if was_ok:
            self._search.lose(confirmed=not self._confirmation.waiting)
        self._confirmation.reset()
        self._waits_for_confirmation = None
        self._in_fixed_map.reset()
        frame.clear_associations()
        frame.T_cw = None
        # A map that was loaded, or used for localization, is the user's, however small.
        active = self._map.active_map
        small = self._is_small and active not in self._kept_maps
        # Others are given up for one that begins. Under a hand none does, and the camera may be
        # found behind it.
        another = self._initializer.shows_enough(frame)
        given_up = wrong_map
        if given_up is None and small and another:
            given_up = active
        return TrackingResult(self.state, estimate, given_up=given_up)

    def _stay(self, frame: core.TrackedFrame) -> None:
        """Go on in the map that a frame was found in, which may have rested."""
        self._loss.followed(frame.timestamp)
        self._n_lost = 0
        if self._seeks_map:
            self._seeks_map = False
            self._initializer.restart([])
        if frame.map_index != self._map.active_map:
            found_in = self._map.activate_map_of(frame.reference_keyframe)
            _log.info("found again at frame %d in map %d", frame.id, found_in)

    @property
    def _is_small(self) -> bool:
        """Whether the map is given up if tracking is lost."""
        active = self._map.active_map
        n_keyframes = self._map.n_keyframes_of(active) - self._initializer.n_between(active)
        return bool(n_keyframes <= self._search.limits.small_map)

    # ---- keyframes -------------------------------------------------------------------------------
    def _extend_map(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> bool:
        """Make a tracked frame a keyframe if the map needs one; whether it was made now."""
        self._insert_confirmed()
        allowed = self._acceptance.allows_keyframe(estimate.evidence)
        if not (allowed and self._keyframe_wanted(frame, estimate)):
            return False
        if estimate.unconfirmed:
            self._waits_for_confirmation = frame
            return False
        if estimate.evidence is not None and estimate.evidence.doubted:
            # Bundle adjustment, which tries them again, would have few inliers to tell them by.
            frame.discard_outliers()
        self._create_keyframe(frame)
        return True

    def _keyframe_wanted(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> bool:
        self._since_keyframe.saw(estimate.n_inliers)
        return self._keyframe_decision.wanted(
            frame,
            self.reference_keyframe,
            estimate.n_inliers,
            self.motion.velocity,
            self._since_keyframe,
        )

    def _insert_confirmed(self) -> None:
        """Make the frame that was found again a keyframe, now that the next one confirmed it.

        Where the map ends it sees more of it than any frame after it.
        """
        found, self._waits_for_confirmation = self._waits_for_confirmation, None
        if found is not None:
            self._create_keyframe(found)

    def _create_keyframe(self, frame: core.TrackedFrame) -> None:
        core.describe(frame.features, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=self._has_depth)
        self._search.reference_keyframe = keyframe
        self._since_keyframe = SinceKeyframe(frame.id, keyframe)
        self._mapping.insert_keyframe(keyframe)
