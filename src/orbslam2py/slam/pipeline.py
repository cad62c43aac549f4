# SPDX-License-Identifier: BSD-3-Clause
"""The steps for one image, in their order: the block diagram of the method.

Mur-Artal and Tardos, "ORB-SLAM2", 2017, figure 2; ``docs/method/index.md``.
"""

from __future__ import annotations

import functools
import logging
import math
import threading
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from orbslam2py import _core as core
from orbslam2py._arguments import is_finite, shown
from orbslam2py._arrays import ByteArray
from orbslam2py._timing import StageStatistics, StageTimer
from orbslam2py.errors import ImageError
from orbslam2py.maps.imu_states import new_keeper
from orbslam2py.maps.map_autosave import MapAutosave, encode_image
from orbslam2py.maps.saved_map import VocabularyIdentity
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.back_end import RESET_PATIENCE, BackEnd
from orbslam2py.slam.config import USUAL_FEATURES
from orbslam2py.slam.events import Callbacks, MapStarted, Relocalized, TrackingLost
from orbslam2py.slam.frame_recorder import FrameRecorder
from orbslam2py.slam.inertial import ImuInterval, ImuVerdict, InertialInput
from orbslam2py.slam.kept_images import KeptImages
from orbslam2py.slam.localization_mode import LocalizationSwitch
from orbslam2py.slam.options import Setup, SystemOptions
from orbslam2py.slam.parts import make_inertial, make_reestimation, make_tracking
from orbslam2py.slam.records import (
    Reason,
    TrackingRecord,
    TrackingResult,
    TrackingState,
)
from orbslam2py.slam.rig_front_end import RigFrontEnd, front_end_of
from orbslam2py.slam.watched_frame import (
    FrameWatcher,
    WatchedFrame,
    frame_features,
)

_log = logging.getLogger(__name__)

#: The year 5138 in seconds since 1970; today in milliseconds, or in what is finer, lies far beyond.
_NO_SECONDS = 1e11

#: Keyframes after which the first frames of a map are estimated again, and frames at the latest.
_SETTLED_MAP, _YOUNG_FRAMES = 10, 250


_NOT_FOLLOWED = (
    "frames are tracked with features: alignment.follow (effort light) is for one camera, or RGB-D "
    f"with {USUAL_FEATURES} features or more, and without an IMU"
)

#: The image; the right image, the depth, the images of a rig, or None; the mask.
_GivenImages = tuple[ByteArray, Any, Any]


class Pipeline:
    """All parts of the method, and the steps for each image.

    One thread at a time delivers images; all other parts can be read from any thread.

    Parameters
    ----------
    setup : Setup
        Camera, visual words and the initial map; with a map, tracking starts lost and searches it.
    options : SystemOptions
        Options of the system.
    callbacks : Callbacks
        Receives events.

    Attributes
    ----------
    front_end, tracking, back_end
        The stages: images to frames, frames to poses, keyframes to a map.
    inertial : InertialInput
        The samples of the IMU that wait for their images.
    localization : LocalizationSwitch
        Localization mode: whether the map is fixed.
    recorder : FrameRecorder
        Poses of all frames.
    keeper : MapAutosave
        The map in files.
    reset_requested : threading.Event
        If set, the next image begins a new map, and the old one is dropped.
    frame_watchers : tuple of callables
        Called for every image; assign another tuple to add one. They must be quick and not raise.
    """

    def __init__(self, setup: Setup, options: SystemOptions, callbacks: Callbacks) -> None:
        sensor = setup.sensor
        self._sensor = sensor
        config = options.full_config.for_features(setup.settings.orb.n_features)
        #: Which positions are measured by patches.
        self.alignment = alignment = config.alignment.for_sensor(sensor)
        self._vocabulary = setup.vocabulary
        self._waits_for_mapping = options.wait_for_mapping and not options.deterministic
        self._keeps_images = options.keyframe_images
        self.front_end = front_end_of(
            setup.settings,
            check_calibration=options.check_calibration,
            keep_images=alignment.uses_points,
            align_right=alignment.right_image,
        )
        self._kept_images = KeptImages(every_frame=config.trajectory.rematch_every_frame)
        self.back_end = back_end = BackEnd(sensor, options, config, callbacks)
        #: Uses the IMU in tracking; None without settings of one.
        self.inertial_tracker = make_inertial(setup, back_end, config.inertial)
        self.tracking = make_tracking(
            setup, back_end, options, config, self.front_end, self.inertial_tracker
        )
        #: Frames are tracked without features where patches are enough.
        self._follows = alignment.follow and self.inertial_tracker is None
        if options.full_config.alignment.follow and not self._follows:
            _log.warning("%s", _NOT_FOLLOWED)
        in_time = not (options.deterministic or options.wait_for_mapping)
        self.inertial = InertialInput(
            setup.imu, back_end.events.worker.offer if in_time else _at_once
        )
        self.localization = LocalizationSwitch(
            back_end.map, 1 if sensor.has_depth else 2, back_end.map_workers
        )
        self.recorder = FrameRecorder(
            back_end.map,
            make_reestimation(setup, back_end, config),
            every_frame=config.trajectory.rematch_every_frame,
        )
        self.statistics = StageStatistics()
        self.reset_requested = threading.Event()
        self.frame_watchers: tuple[FrameWatcher, ...] = ()
        self.n_resets = 0
        # A failed map, which is dropped before the next image.
        self._given_up: int | None = None
        self._start_failed = False
        self._next_frame_id = 0
        self._last_timestamp = -math.inf
        self._told_of_seconds = False
        tracker = self.inertial_tracker
        # Without an IMU the states of a loaded map are kept, for files.
        self._imu_states = new_keeper() if tracker is None else tracker.keyframes
        if setup.loaded is not None:
            setup.loaded.restore(
                back_end.map, setup.vocabulary, back_end.keyframe_index, self._imu_states
            )
            if tracker is not None:
                tracker.map_loaded()
            self.tracking.begin_in_loaded_map(setup.initial_pose)
        self._last_map = -1 if setup.loaded is None else max(back_end.map.maps)
        self.keeper = MapAutosave(
            back_end.map,
            self.recorder.recorded,
            setup.settings,
            functools.partial(VocabularyIdentity.of, setup.vocabulary, setup.vocabulary_name),
            seed=options.seed,
            options=asdict(options),
            earlier=setup.loaded,
            inertial=self._imu_states,
            patches=options.point_patches,
        )

    def start(self) -> None:
        """Start the threads of the workers, after all parts are connected."""
        for worker in self.back_end.workers:
            worker.start()

    # ---- one image -------------------------------------------------------------------------------
    @property
    def feature_factor(self) -> int:
        """Features that a single camera's next image needs, in multiples of the settings'."""
        return self.tracking.feature_factor(localize=self.localization.on)

    def build_frame(
        self,
        image: ByteArray,
        second: Any,
        frame_id: int,
        timestamp: float,
        timer: StageTimer,
        mask: Any,
    ) -> core.Frame:
        """Make a frame of the images of one moment; see `System.track`."""
        front_end = self.front_end
        if isinstance(front_end, RigFrontEnd):
            return front_end.rig(second, frame_id, timestamp, timer, mask)
        if self._sensor is Sensor.STEREO:
            return front_end.stereo(image, second, frame_id, timestamp, timer, mask)
        if self._sensor is Sensor.RGBD:
            return front_end.rgbd(image, second, frame_id, timestamp, timer, mask)
        factor = self.feature_factor
        return front_end.monocular(image, frame_id, timestamp, timer, mask, feature_factor=factor)

    def process(
        self, timestamp: float, image: ByteArray, second: Any, mask: Any, *, details: bool
    ) -> TrackingRecord:
        """Take one image from its pixels to its record.

        Parameters
        ----------
        timestamp : float
            Seconds.
        image : array of uint8, (h, w) or (h, w, 3) or (h, w, 4)
            The image, the left one of a pair; viewers get it.
        second : array, or None
            The right image, the depth, or the images of a rig.
        mask : array of uint8, or None
            Where no keypoint may lie.
        details : bool
            The record contains keypoints and matches.
        """
        self._make_ready(timestamp)
        tracking = self.tracking
        timer = StageTimer()
        state_before = tracking.state
        watchers = self.frame_watchers
        images = image, second, mask
        with_details = details or bool(watchers)
        followed = self._follow(timestamp, images, timer, details=with_details)
        frame, outcome, interval = followed or self._track(
            timestamp, images, timer, details=with_details
        )
        self.statistics.add(timer.milliseconds)
        self._kept_images.note(
            frame.features,
            is_keyframe=outcome.is_keyframe,
            waiting=outcome.state is not TrackingState.OK or outcome.estimate.unconfirmed,
        )

        if outcome.estimate.unconfirmed:
            self.recorder.doubt(frame)
        self._keep(frame, outcome)
        record = self._record(frame, outcome, timer, details=details)
        if self.inertial.check is not None:
            self.inertial.look(interval, record, frame.big_change)
        self._announce(state_before, record)
        self.back_end.mapping.start()
        for watch in watchers:
            watch(WatchedFrame(image, record, frame, outcome.inliers, tracking))
        if self._keeps_images and record.is_keyframe:
            self.keeper.keep_image(record.reference_keyframe, encode_image(image))
        return record

    def _follow(
        self, timestamp: float, images: _GivenImages, timer: StageTimer, *, details: bool
    ) -> tuple[core.TrackedFrame, TrackingResult, None] | None:
        """Track images without features; return None where they are needed."""
        image, depth, mask = images
        if not self._follows or mask is not None or self.localization.on:
            return None
        if self._waits_for_mapping:
            with timer("wait"):
                self.back_end.mapping.worker.wait_until_idle(unless_held=True)
        with timer("track"):
            number = self._next_frame_id
            followed = self.tracking.follow(image, depth, number, timestamp, details=details)
            if followed is None:
                return None
            self._count(timestamp)
            return *followed, None

    def _track(
        self, timestamp: float, images: _GivenImages, timer: StageTimer, *, details: bool
    ) -> tuple[core.TrackedFrame, TrackingResult, ImuInterval | None]:
        """Track images with features and, where there is one, an IMU."""
        image, second, mask = images
        with timer("track"):
            # Features are found while mapping works: they do not depend on the map.
            features = self.build_frame(image, second, self._next_frame_id, timestamp, timer, mask)
            frame = core.TrackedFrame(features)
        if self.localization.on:
            # Aligned points would pull frames towards the map while odometry still holds them.
            core.release_images(features)
        if self._waits_for_mapping:
            with timer("wait"):
                self._wait_for_mapping(frame)
        self._look_again_at_start()
        with timer("track"):
            self._count(timestamp)
            # The samples of the IMU from the image before to this one; None without an IMU.
            interval = self._take_samples(timestamp)
            outcome = self.tracking.track(
                frame, timer, localize=self.localization.on, details=details, interval=interval
            )
        return frame, outcome, interval

    def _count(self, timestamp: float) -> None:
        """Count an image: every id is one image."""
        self._next_frame_id += 1
        self._last_timestamp = timestamp

    def _make_ready(self, timestamp: float) -> None:
        for worker in self.back_end.workers:
            worker.raise_if_failed()
        if self.reset_requested.is_set() or self._given_up is not None:
            self._reset()
        self._check_timestamp(timestamp)
        self.localization.apply()

    def _check_timestamp(self, timestamp: float) -> None:
        if not is_finite(timestamp):
            raise ImageError(
                f"the time stamp must be a finite number of seconds, got {shown(timestamp)}"
            )
        if abs(timestamp) >= _NO_SECONDS and not self._told_of_seconds:
            self._told_of_seconds = True
            _log.warning(
                "the time stamp %s is too large for seconds, so that seconds after which something "
                "happens pass at once; divide nanoseconds by 1e9",
                shown(timestamp),
            )
        if timestamp <= self._last_timestamp:
            raise ImageError(
                f"time stamps must grow: {timestamp!r} came after {self._last_timestamp!r}"
            )

    def _wait_for_mapping(self, frame: core.TrackedFrame) -> None:
        worker = self.back_end.mapping.worker
        if worker.held or self._sensor.has_depth:
            # A frame that is worth a keyframe waits when that is known.
            worker.wait_until_waiting(at_most=1)
            return
        worker.wait_until_waiting(at_most=0)
        if not worker.idle:
            # There is time, and a keyframe needs its words.
            core.describe(frame.features, self._vocabulary)
        # Which frames become keyframes must not depend on the clock; and a single camera gets new
        # points from mapping alone: on fast motion the map would end before the mapper is done.
        worker.wait_until_idle(unless_held=True)

    def _look_again_at_start(self) -> None:
        """Estimate the first frames of a single camera's map again, once this map has settled."""
        n_young = self.recorder.n_young
        if n_young >= _YOUNG_FRAMES or (
            n_young > 0 and self.back_end.map.n_active_keyframes > _SETTLED_MAP
        ):
            self.recorder.reestimate_first_frames()

    def _take_samples(self, timestamp: float) -> ImuInterval | None:
        """Take the samples since the image before, and whether the IMU may be used."""
        check, tracker = self.inertial.check, self.inertial_tracker
        if check is not None and tracker is not None:
            tracker.allowed = check.verdict is not ImuVerdict.HELD_BACK
            tracker.may_start = check.verdict is ImuVerdict.FITS
        return self.inertial.take(timestamp)

    def _keep(self, frame: core.TrackedFrame, outcome: TrackingResult) -> None:
        if outcome.given_up is not None:
            self._start_failed = outcome.estimate.reason is Reason.INITIAL_MAP_FAILED
            if not self._start_failed:
                _log.info("lost soon after initialization; starting a new map")
            self._given_up = outcome.given_up
        elif outcome.state in (TrackingState.OK, TrackingState.LOST):
            if outcome.earlier:
                self.recorder.begin(outcome.earlier)
            self.recorder.record(
                frame,
                lost=outcome.state is TrackingState.LOST,
                fixed_map=self.localization.on,
            )

    def _record(
        self,
        frame: core.TrackedFrame,
        outcome: TrackingResult,
        timer: StageTimer,
        *,
        details: bool,
    ) -> TrackingRecord:
        ok = outcome.state is TrackingState.OK
        estimate = outcome.estimate
        T_cw = frame.T_cw if ok else None
        return TrackingRecord(
            frame_id=self._next_frame_id - 1,
            timestamp=self._last_timestamp,
            map_index=frame.map_index if ok else self.back_end.map.active_map,
            state=outcome.state,
            reason=estimate.reason,
            T_cw=T_cw.matrix if T_cw is not None else None,
            covariance=estimate.covariance if ok else None,
            n_matches=estimate.n_matches,
            n_inliers=estimate.n_inliers if ok else 0,
            is_keyframe=outcome.is_keyframe,
            reference_keyframe=self.tracking.reference_keyframe,
            visual_odometry=ok and estimate.visual_odometry,
            unconfirmed=ok and estimate.unconfirmed,
            milliseconds=timer.milliseconds,
            features=frame_features(frame, outcome.inliers) if details else None,
            evidence=estimate.evidence,
            method=estimate.method if ok and not outcome.begins_map else None,
            inertial=None if self.inertial_tracker is None else self.inertial_tracker.record(),
        )

    def _announce(self, before: TrackingState, record: TrackingRecord) -> None:
        events = self.back_end.events
        here = (record.map_index, record.frame_id, record.timestamp)
        if record.state is TrackingState.OK and record.map_index > self._last_map:
            self._last_map = record.map_index
            events.post(MapStarted(*here))
        if before is TrackingState.OK and record.state is TrackingState.LOST:
            events.post(TrackingLost(*here, str(record.reason)))
        elif before is TrackingState.LOST and record.T_wc is not None:
            events.post(Relocalized(*here, record.T_wc))

    def request_reset(self) -> None:
        """Begin a new map with the next image, and drop the old one."""
        self.reset_requested.set()

    # ---- a new map -------------------------------------------------------------------------------
    def _reset(self) -> None:
        # Cleared first: a reset that is asked for while this one is carried out is another one.
        asked = self.reset_requested.is_set()
        self.reset_requested.clear()
        try:
            if asked or self._given_up is None:
                self._forget_all()
                ended = True
            else:
                ended = self._give_up(self._given_up)
        except BaseException:
            if asked:
                self.reset_requested.set()
            raise
        self._given_up = None
        # A map that never began was not given up.
        self.n_resets += ended and not self._start_failed
        self._start_failed = False

    def _forget_all(self) -> None:
        _log.info("resetting: map %d ends", self.back_end.map.active_map)
        self.back_end.reset(RESET_PATIENCE, keep=self.recorder.end_maps)
        self.tracking.reset()
        self.front_end.reset()
        self.inertial.restart()
        self._forget_imu()
        self._next_frame_id = 0
        self._last_timestamp = -math.inf

    def _give_up(self, map_index: int) -> bool:
        """End a map; return False if it has been merged since."""
        slam_map = self.back_end.map
        if len(slam_map.maps) > 1 or slam_map.active_map != map_index:
            keep = self.recorder.end_map
            if not self.back_end.drop_map(map_index, RESET_PATIENCE, keep=keep):
                return False
            _log.info("map %d ends", map_index)
            self.tracking.go_back()
        elif self._sensor.has_depth:
            # Depths begin a map with one frame.
            self._forget_all()
        else:
            # One camera's frames from before serve again.
            _log.info("map %d ends", map_index)
            self.back_end.reset(RESET_PATIENCE, keep=self.recorder.end_maps)
            self.tracking.restart()
            self._forget_imu()
        return True

    def _forget_imu(self) -> None:
        """Drop the states at keyframes, whose numbers begin anew."""
        self._imu_states.clear()
        if self.inertial_tracker is not None:
            self.inertial_tracker.reset()


def _at_once(work: Callable[[], None]) -> None:
    """Do something now, where recorded images wait and results must be equal."""
    work()
