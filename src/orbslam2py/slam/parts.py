# SPDX-License-Identifier: BSD-3-Clause
"""Makes the parts of the pipeline of settings, options and thresholds."""

from __future__ import annotations

from orbslam2py._values import replace
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.acceptance.multi_hypothesis_search import MultiHypothesisSearch
from orbslam2py.slam.acceptance.pose_acceptance import PoseAcceptance
from orbslam2py.slam.acceptance.pose_validator import PoseValidator
from orbslam2py.slam.back_end import BackEnd
from orbslam2py.slam.config import Config
from orbslam2py.slam.followed_frames import FollowedFrames
from orbslam2py.slam.frame_reestimation import FrameReestimation
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.slam.inertial import InertialTracker
from orbslam2py.slam.inertial_config import InertialConfig
from orbslam2py.slam.initialization import DepthInitializer, Initializer, MonocularInitializer
from orbslam2py.slam.initialization.earlier_frames import EarlierFrames
from orbslam2py.slam.keyframe_decision import KeyframeDecision
from orbslam2py.slam.options import Setup, SystemOptions
from orbslam2py.slam.pose_search import PoseSearch
from orbslam2py.slam.relocalization import Relocalizer
from orbslam2py.slam.tracking import Tracking

#: More inliers than a frame has.
_ALL_INLIERS = 1_000_000
#: Keyframes of a single camera's map from which on its frames need no features: a younger map still
#: changes its shape.
_FEWEST_KEYFRAMES = 10


def make_reestimation(setup: Setup, back_end: BackEnd, config: Config) -> FrameReestimation:
    """Make what matches past frames again: there is time to align all inliers."""
    alignment = config.alignment
    if alignment.tracked_inliers:
        alignment = replace(alignment, tracked_inliers=_ALL_INLIERS)
    search = _make_search(setup, back_end, replace(config, alignment=alignment))
    return FrameReestimation(back_end.map, search)


def _make_search(
    setup: Setup, back_end: BackEnd, config: Config, relocalizer: Relocalizer | None = None
) -> PoseSearch:
    return PoseSearch(
        back_end.map,
        setup.vocabulary,
        setup.sensor,
        relocalizer,
        config.tracking,
        config.alignment.for_sensor(setup.sensor),
        pixels_per_radian=setup.settings.camera.pixels_per_radian,
    )


def make_inertial(
    setup: Setup, back_end: BackEnd, config: InertialConfig
) -> InertialTracker | None:
    """Make the tracker of an IMU; return None without settings of one."""
    if setup.imu is None:
        return None
    workers = back_end.map_workers
    tracker = InertialTracker(
        back_end.map,
        setup.imu,
        metric=setup.sensor.has_depth,
        idle=lambda: all(worker.idle for worker in workers),
        config=config,
    )
    if setup.sensor is not Sensor.RGBD:
        # Where depths are measured, images alone determine keyframes better.
        back_end.mapping.inertial = tracker.keyframes
    return tracker


def make_tracking(
    setup: Setup,
    back_end: BackEnd,
    options: SystemOptions,
    config: Config,
    front_end: FrontEnd,
    inertial: InertialTracker | None,
) -> Tracking:
    """Make the tracker."""
    seed = options.seed
    sensor, vocabulary = setup.sensor, setup.vocabulary
    slam_map, mapping = back_end.map, back_end.mapping
    n_features = setup.settings.orb.n_features

    def acceptance_of(searching: PoseSearch) -> PoseAcceptance:
        judge = PoseValidator(
            searching.motion_model_window,
            setup.settings.camera.pixels_per_radian,
            config.acceptance,
        )
        return PoseAcceptance(searching, judge, MultiHypothesisSearch(searching, judge))

    initializer: Initializer
    if sensor is Sensor.MONOCULAR:
        earlier = _make_search(setup, back_end, config)
        initializer = MonocularInitializer(
            slam_map,
            vocabulary,
            mapping,
            seed,
            EarlierFrames(earlier, acceptance_of(earlier)),
            config=config.initialization,
        )
    else:
        initializer = DepthInitializer(
            slam_map, vocabulary, mapping, n_features, config.initialization
        )
    searching = _make_search(
        setup,
        back_end,
        config,
        Relocalizer(
            slam_map,
            back_end.keyframe_index,
            seed,
            fix_scale=sensor.has_depth,
            config=config.relocalization,
        ),
    )
    followed = None
    if inertial is None and config.alignment.for_sensor(sensor).follow:
        followed = FollowedFrames(slam_map, front_end, 0 if sensor.has_depth else _FEWEST_KEYFRAMES)
    return Tracking(
        slam_map,
        vocabulary,
        mapping,
        initializer=initializer,
        search=searching,
        acceptance=acceptance_of(searching),
        keyframe_decision=KeyframeDecision(
            slam_map,
            mapping.worker,
            sensor,
            setup.settings.max_keyframe_interval,
            config.keyframes,
            waits=options.wait_for_mapping and not options.deterministic,
        ),
        config=config,
        has_depth=sensor.has_depth,
        new_map_after=options.new_map_after if options.several_maps else None,
        inertial=inertial,
        followed=followed,
    )
