# SPDX-License-Identifier: BSD-3-Clause
"""The ways to a frame's pose: each takes a frame and returns one estimate.

Mur-Artal, Montiel and Tardos, 2015, sections V-B to V-D; ``docs/method/tracking.md``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py import _core as core
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.pose_search.local_map_search import LocalMapSearch
from orbslam2py.slam.pose_search.motion_model import MotionModel
from orbslam2py.slam.pose_search.probation_period import ProbationPeriod
from orbslam2py.slam.pose_search.refined_pose import RefinedPose
from orbslam2py.slam.records import PoseEstimate, PoseMethod, Reason
from orbslam2py.slam.relocalization import LastKnownPose, Relocalizer


class PoseSearch:
    """Finds a frame's pose from the last frame, a keyframe, the whole map or the local map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Visual words for matching with keyframes.
    sensor : Sensor
        What the images come from.
    max_keyframe_interval : int
        Frames of one second: see `ProbationPeriod`.
    relocalizer : Relocalizer, optional
        Finds lost frames in the map; without it none is found there.
    config : TrackingConfig
        Limits.

    Attributes
    ----------
    motion : MotionModel
        The last frame and the speed.
    reference_keyframe : int
        Shares most points with the last frame that had a pose, -1 before the first.
    local_map : orbslam2py._core.LocalMap or None
        Where the last frame was refined, None before the first.
    local_map_search : LocalMapSearch
        Refines poses with the points around them.
    proving : ProbationPeriod
        What is asked of frames after the camera was found again, or a map began.
    map_is_fixed : bool
        The map is not to change: what is seen of it is not counted.
    searches_loaded_map : bool
        The camera was not found yet in the map that was loaded.
    initial_pose : Pose or None
        ``T_cw`` that the user gave for the beginning in a loaded map; tried before all else until
        a frame is found.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        sensor: Sensor,
        max_keyframe_interval: int,
        relocalizer: Relocalizer | None,
        config: TrackingConfig,
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._sensor = sensor
        self._relocalizer = relocalizer
        self.limits = config
        self.proving = ProbationPeriod(max_keyframe_interval, config, has_depth=sensor.has_depth)
        self.local_map_search = LocalMapSearch(slam_map, sensor, self.proving, config)
        self.reset()

    def reset(self) -> None:
        """Forget the frames before."""
        self.motion = MotionModel()
        self.reference_keyframe = -1
        self.local_map: core.LocalMap | None = None
        self.proving.reset()
        self.initial_pose: core.Pose | None = None
        self.searches_loaded_map = False
        self.map_is_fixed = False
        self._place_of_loss: LastKnownPose | None = None
        if self._relocalizer is not None:
            self._relocalizer.reset()

    def lose(self, *, confirmed: bool) -> None:
        """Tracking was lost: it is searched from where the last frame was.

        Parameters
        ----------
        confirmed : bool
            False if the last frame had just been found again: then it is searched on from where
            tracking was lost before.
        """
        if confirmed:
            self.proving.lose()
            self._place_of_loss = LastKnownPose(
                self.motion.last, self.motion.velocity, self.reference_keyframe
            )
            if self._relocalizer is not None:
                self._relocalizer.lose(self._place_of_loss)
        else:
            self.motion = MotionModel()
            self.reference_keyframe = -1
            if self._place_of_loss is not None:
                self.motion.remember(self._place_of_loss.last)
                self.reference_keyframe = self._place_of_loss.reference_keyframe
        self.motion.lose()

    def confirm(self) -> None:
        """A pose found again is believed: the place of the loss is history."""
        self._place_of_loss = None
        if self._relocalizer is not None:
            self._relocalizer.reset()

    @property
    def has_last_frame(self) -> bool:
        """Whether any frame had a pose yet; if not, the map was loaded."""
        return self.motion.has_last

    def follow_map(self) -> None:
        """Bring the last frame and the reference keyframe up to date with the map."""
        self.motion.follow_map(self._map)
        self.reference_keyframe = self._map.living(self.reference_keyframe)

    @property
    def motion_model_window(self) -> float:
        """Half width of the motion model's search window, pixels at level 0."""
        stereo = self._sensor is Sensor.STEREO
        limits = self.limits
        return limits.motion_model_window_stereo if stereo else limits.motion_model_window

    # ---- first estimate --------------------------------------------------------------------------
    def by_motion_model(
        self, frame: core.TrackedFrame, *, beyond_the_map: bool = False
    ) -> PoseEstimate:
        """From the points that the last frame saw, searched where its speed puts them.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        beyond_the_map : bool
            Also from depths that the last frame measured and the map does not hold.
        """
        motion = self.motion
        motion.predict(frame)
        if beyond_the_map:
            core.add_temporary_points(motion.last, motion.last_points)
        return self.around_prediction(frame, self.motion_model_window)

    def around_prediction(self, frame: core.TrackedFrame, narrow: float) -> PoseEstimate:
        """From the points that the last frame saw, searched where the frame's pose puts them.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame, with a predicted pose.
        narrow : float
            Half width of the search window, pixels at level 0; it is widened once.
        """
        limits, motion = self.limits, self.motion
        n_matches = 0
        for window in (narrow, limits.motion_model_widening * narrow):
            frame.clear_associations()
            n_matches = core.match_last_frame(
                frame, motion.last, motion.last_points, window, self._sensor.has_depth
            )
            if n_matches >= limits.motion_model_matches:
                return self._optimize(frame, n_matches, Reason.FEW_MATCHES_LAST_FRAME)
        return PoseEstimate(Reason.FEW_MATCHES_LAST_FRAME, n_matches)

    def by_reference_keyframe(self, frame: core.TrackedFrame) -> PoseEstimate:
        """From the reference keyframe's points, matched by words, beginning at the last pose."""
        self.motion.stand_still(frame)
        core.describe(frame.features, self._vocabulary)
        n_matches = core.match_keyframe_by_words(
            self._map, self.reference_keyframe, frame, self.limits.reference_ratio
        )
        if n_matches < self.limits.reference_matches:
            return PoseEstimate(Reason.FEW_MATCHES_REFERENCE, n_matches)
        estimate = self._optimize(frame, n_matches, Reason.FEW_INLIERS_REFERENCE)
        return replace(estimate, method=PoseMethod.REFERENCE_KEYFRAME)

    def by_keyframes_around(self, frame: core.TrackedFrame, n_neighbours: int) -> PoseEstimate:
        """The same from that of the reference keyframe and its neighbours that matches best."""
        self.motion.stand_still(frame)
        core.describe(frame.features, self._vocabulary)
        best, n_best = frame, -1
        neighbours = self._map.best_neighbours(self.reference_keyframe, n_neighbours)
        for keyframe in (self.reference_keyframe, *map(int, neighbours)):
            version = core.TrackedFrame(frame.features)
            self.motion.stand_still(version)
            n_matches = core.match_keyframe_by_words(
                self._map, keyframe, version, self.limits.reference_ratio
            )
            if n_matches > n_best:
                best, n_best = version, n_matches
        frame.take_over(best)
        if n_best < self.limits.reference_matches:
            return PoseEstimate(Reason.FEW_MATCHES_REFERENCE, n_best)
        return self._optimize(frame, n_best, Reason.FEW_INLIERS_REFERENCE)

    def by_all_keypoints(self, frame: core.TrackedFrame) -> PoseEstimate:
        """From the reference keyframe's points, each compared with every keypoint of the frame.

        Finds the way from one frame to the next where nothing is known of it, and what was seen
        looks different by now: in the second frame of a map that begins in a fast car.
        """
        failed = PoseEstimate(Reason.FEW_MATCHES_REFERENCE)
        if self._relocalizer is None or self.reference_keyframe < 0:
            return failed
        n_inliers = self._relocalizer.compare_with(frame, [self.reference_keyframe])
        if n_inliers == 0:
            return failed
        frame.share_anchor(self.motion.last)
        return PoseEstimate(
            n_matches=n_inliers, n_inliers=n_inliers, method=PoseMethod.ALL_KEYPOINTS
        )

    def by_relocalization(self, frame: core.TrackedFrame) -> PoseEstimate:
        """From the user's guess, if any; else from any keyframe that looks like the frame."""
        not_found = Reason.NOT_FOUND_IN_MAP
        if self.searches_loaded_map and not self.has_last_frame:
            not_found = Reason.SEARCHING_LOADED_MAP
        if self._relocalizer is None:
            return PoseEstimate(not_found)
        n_inliers = 0
        if self.initial_pose is not None:
            n_inliers = self._relocalizer.relocalize_near(frame, self.initial_pose)
        if n_inliers == 0:
            core.describe(frame.features, self._vocabulary)
            n_inliers = self._relocalizer.relocalize(frame)
        if n_inliers == 0:
            several = self._relocalizer.looks_like_several
            return PoseEstimate(Reason.SEVERAL_PLACES if several else not_found)
        core.anchor_frame(self._map, frame, self._some_keyframe_around(frame))
        return PoseEstimate(
            n_matches=n_inliers,
            n_inliers=n_inliers,
            relocalized=True,
            where_expected=self._relocalizer.where_expected,
            method=PoseMethod.RELOCALIZATION,
        )

    def _some_keyframe_around(self, frame: core.TrackedFrame) -> int:
        """Any keyframe of the map that the frame was found in, until its local map is searched."""
        slam_map = self._map
        ids = frame.map_points
        found_in = slam_map.active_map
        for point in ids[ids >= 0].tolist():
            of_point = slam_map.map_of_point(point)
            if of_point >= 0:
                found_in = of_point
                break
        if slam_map.map_of(self.reference_keyframe) == found_in:
            return self.reference_keyframe
        return int(slam_map.root(found_in))

    def _optimize(self, frame: core.TrackedFrame, n_matches: int, too_few: Reason) -> PoseEstimate:
        optimized = core.optimize_pose(frame)
        estimate = PoseEstimate(
            n_matches=n_matches,
            n_inliers=optimized.n_inliers,
            covariance=optimized.covariance,
            discarded=frame.discard_outliers(),
        )
        enough = estimate.n_inliers >= self.limits.map_matches
        return estimate if enough else estimate.failed(too_few)

    # ---- local map -------------------------------------------------------------------------------
    def in_local_map(self, frame: core.TrackedFrame, first: PoseEstimate) -> RefinedPose:
        """Refine a first estimate with all points around it, and see how many are found.

        Nothing is remembered of it before `settle`: there may be several ways to a pose.
        """
        refined = self.local_map_search.refine(frame, first)
        if refined.estimate.visual_odometry:
            return self.beyond_the_map(frame, refined.estimate)
        return refined

    def beyond_the_map(self, frame: core.TrackedFrame, odometry: PoseEstimate) -> RefinedPose:
        """Take a pose that hangs on the depths of the frame before; these should be in view."""
        assert frame.T_cw is not None
        n_predicted = core.count_staying(self.motion.last, frame.T_cw)
        return RefinedPose(frame, odometry, None, np.zeros(0, np.int64), n_predicted)

    def settle(self, refined: RefinedPose) -> None:
        """Take a refined pose, found or not, as that of its frame."""
        if refined.local_map is None:
            refined.frame.discard_outliers()
            return
        self.local_map = local_map = refined.local_map
        if local_map.reference_keyframe >= 0:
            self.reference_keyframe = local_map.reference_keyframe
        if not self.map_is_fixed:
            core.count_sightings(self._map, refined.frame, refined.visible)
        if self._sensor.has_depth:
            refined.frame.discard_outliers()
