# SPDX-License-Identifier: BSD-3-Clause
"""Methods that estimate a frame's pose: each takes a frame and returns one estimate.

Mur-Artal, Montiel and Tardos, 2015, sections V-B to V-D; ``docs/method/tracking.md``.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import AlignmentConfig, TrackingConfig
from orbslam2py.slam.pose_search.local_map_search import LocalMapSearch, RefinedPose
from orbslam2py.slam.records import PoseEstimate, PoseMethod, Reason
from orbslam2py.slam.relocalization import Relocalizer
from orbslam2py.slam.state import Motion, State

_WIDEST = 60.0  # half width of the search window around the prediction of an IMU, pixels


class PoseSearch:
    """Estimates a frame's pose by the last frame, a keyframe, the whole map or the local map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Visual words for matching with keyframes.
    sensor : Sensor
        The sensor.
    relocalizer : Relocalizer, optional
        Finds lost frames in the map; None: no relocalization.
    config : TrackingConfig
        Limits.
    pixels_per_radian : float
        Of the camera: the search window follows the covariance of an IMU.

    Attributes
    ----------
    map : orbslam2py._core.Map
        The map.
    has_depth : bool
        Whether frames measure depths.
    limits : TrackingConfig
        Thresholds.
    local_map_search : LocalMapSearch
        Refines poses with the points of the local map.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        sensor: Sensor,
        relocalizer: Relocalizer | None,
        config: TrackingConfig,
        alignment: AlignmentConfig | None = None,
        *,
        pixels_per_radian: float = 0.0,
    ) -> None:
        self.map = slam_map
        self._pixels_per_radian = pixels_per_radian
        self._vocabulary = vocabulary
        self._sensor = sensor
        self.has_depth = sensor.has_depth
        self._relocalizer = relocalizer
        self.limits = config
        self.local_map_search = LocalMapSearch(slam_map, sensor, config, alignment)

    @property
    def motion_model_window(self) -> float:
        """Half width of the motion model's search window, pixels at level 0."""
        stereo = self._sensor is Sensor.STEREO
        limits = self.limits
        return limits.motion_model_window_stereo if stereo else limits.motion_model_window

    # ---- first estimate --------------------------------------------------------------------------
    def by_motion_model(
        self, frame: core.TrackedFrame, state: State, *, beyond_the_map: bool = False
    ) -> PoseEstimate:
        """Use the points of the last frame, searched around their predicted pixels.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        state : State
            The state before it.
        beyond_the_map : bool
            Use depths measured in the last frame too, which are no map points.
        """
        motion = state.motion
        motion.predict(frame)
        if beyond_the_map:
            core.add_temporary_points(motion.last, motion.last_points)
        of_imu = min(_WIDEST, 3 * self._pixels_per_radian * motion.deviation_in_image())
        return self.around_prediction(frame, motion, max(self.motion_model_window, of_imu))

    def around_prediction(
        self, frame: core.TrackedFrame, motion: Motion, narrow: float
    ) -> PoseEstimate:
        """Use the points of the last frame, searched around their pixels by the frame's pose.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame, with a predicted pose.
        motion : Motion
            The last frame and its points.
        narrow : float
            Half width of the search window, pixels at level 0; it is widened once.
        """
        limits = self.limits
        n_matches = 0
        for window in (narrow, limits.motion_model_widening * narrow):
            n_matches = core.match_last_frame(
                frame, motion.last, motion.last_points, window, self.has_depth
            )
            if n_matches >= limits.motion_model_matches:
                return self._optimize(frame, n_matches, Reason.FEW_MATCHES_LAST_FRAME)
            frame.clear_associations()
        return PoseEstimate(Reason.FEW_MATCHES_LAST_FRAME, n_matches)

    def by_keyframes(
        self, frame: core.TrackedFrame, state: State, n_neighbours: int = 0
    ) -> PoseEstimate:
        """Use a keyframe's points, matched by words; start at the last pose.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame.
        state : State
            The state before it.
        n_neighbours : int
            Number of covisible keyframes of the reference keyframe that are also tried; the one
            with most matches is used.
        """
        state.motion.stand_still(frame)
        core.describe(frame.features, self._vocabulary)
        keyframes = [state.reference_keyframe]
        if n_neighbours:
            keyframes += map(int, self.map.best_neighbours(keyframes[0], n_neighbours))
        n_best = -1
        for keyframe in keyframes:
            version = core.TrackedFrame(frame.features)
            state.motion.stand_still(version)
            n_matches = core.match_keyframe_by_words(
                self.map, keyframe, version, self.limits.reference_ratio
            )
            if n_matches > n_best:
                best, n_best = version, n_matches
        frame.take_over(best)
        if n_best < self.limits.reference_matches:
            return PoseEstimate(Reason.FEW_MATCHES_REFERENCE, n_best)
        estimate = self._optimize(frame, n_best, Reason.FEW_INLIERS_REFERENCE)
        return replace(estimate, method=PoseMethod.REFERENCE_KEYFRAME)

    def near_prediction(self, frame: core.TrackedFrame, state: State) -> PoseEstimate:
        """From the points of the map around the pose that an IMU predicts.

        After some seconds without an image the camera sees other points than the last frame.
        """
        failed = PoseEstimate(Reason.FEW_MATCHES_LAST_FRAME)
        prior = state.motion.prior()
        if prior is None or self._relocalizer is None:
            return failed
        n_inliers = self._relocalizer.relocalize_near(frame, prior.mean)
        if n_inliers == 0:
            return failed
        keyframe = self._some_keyframe_around(frame, state.reference_keyframe)
        core.anchor_frame(self.map, frame, keyframe)
        return PoseEstimate(
            n_matches=n_inliers, n_inliers=n_inliers, method=PoseMethod.NEAR_PREDICTION
        )

    def by_all_keypoints(self, frame: core.TrackedFrame, state: State) -> PoseEstimate:
        """Use the reference keyframe's points; compare each with every keypoint of the frame.

        This works without a prediction and after large changes of the image: in the second frame of
        a map that begins in a fast car.
        """
        failed = PoseEstimate(Reason.FEW_MATCHES_REFERENCE)
        if self._relocalizer is None or state.reference_keyframe < 0:
            return failed
        n_inliers = self._relocalizer.compare_with(frame, [state.reference_keyframe])
        if n_inliers == 0:
            return failed
        frame.share_anchor(state.motion.last)
        return PoseEstimate(
            n_matches=n_inliers, n_inliers=n_inliers, method=PoseMethod.ALL_KEYPOINTS
        )

    def by_relocalization(
        self, frame: core.TrackedFrame, state: State
    ) -> tuple[PoseEstimate, State]:
        """Use the user's guess, if any; else any keyframe that looks like the frame."""
        not_found = Reason.NOT_FOUND_IN_MAP
        if state.in_loaded_map and state.motion.last_frame is None:
            not_found = Reason.SEARCHING_LOADED_MAP
        if self._relocalizer is None:
            return PoseEstimate(not_found), state
        n_inliers = 0
        if state.initial_pose is not None:
            n_inliers = self._relocalizer.relocalize_near(frame, state.initial_pose)
        if n_inliers == 0:
            core.describe(frame.features, self._vocabulary)
            found, lost = self._relocalizer.relocalize(frame, state.lost)
            state = replace(state, lost=lost)
            n_inliers = found.n_inliers
            if n_inliers == 0:
                several = Reason.SEVERAL_PLACES if found.is_ambiguous else not_found
                return PoseEstimate(several), state
        keyframe = self._some_keyframe_around(frame, state.reference_keyframe)
        core.anchor_frame(self.map, frame, keyframe)
        estimate = PoseEstimate(
            n_matches=n_inliers,
            n_inliers=n_inliers,
            relocalized=True,
            method=PoseMethod.RELOCALIZATION,
        )
        return estimate, state

    def _some_keyframe_around(self, frame: core.TrackedFrame, reference_keyframe: int) -> int:
        """Return any keyframe of the frame's map, for use before the local map is searched."""
        slam_map = self.map
        ids = frame.map_points
        found_in = slam_map.active_map
        for point in ids[ids >= 0].tolist():
            of_point = slam_map.map_of_point(point)
            if of_point >= 0:
                found_in = of_point
                break
        if slam_map.map_of(reference_keyframe) == found_in:
            return reference_keyframe
        return int(slam_map.root(found_in))

    def _optimize(self, frame: core.TrackedFrame, n_matches: int, too_few: Reason) -> PoseEstimate:
        n_inliers, covariance, discarded = core.estimate_pose(frame)
        estimate = PoseEstimate(
            n_matches=n_matches, n_inliers=n_inliers, covariance=covariance, discarded=discarded
        )
        enough = n_inliers >= self.limits.map_matches
        return estimate if enough else estimate.failed(too_few)

    def settle(self, refined: RefinedPose, state: State, *, fixed_map: bool) -> State:
        """Store a refined pose, found or not, in its frame.

        Parameters
        ----------
        refined : RefinedPose
            The pose.
        state : State
            The state before it.
        fixed_map : bool
            Localization mode: the map does not count these observations.
        """
        if refined.local_map is None:
            refined.frame.discard_outliers()
            return state
        local_map = refined.local_map
        reference = local_map.reference_keyframe
        if reference < 0:
            reference = state.reference_keyframe
        if not fixed_map:
            core.count_sightings(self.map, refined.frame, refined.visible)
        if self.has_depth:
            refined.frame.discard_outliers()
        return replace(state, local_map=local_map, reference_keyframe=reference)
