# SPDX-License-Identifier: BSD-3-Clause
"""The system: images in, poses and a map out."""

from __future__ import annotations

import logging
import math
import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py.errors import ImageError, StateError, WorkerError
from orbslam2py.maps.snapshot import (
    frame_features,
    frame_trajectory,
)
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings, resolve_settings
from orbslam2py.slam.back_end import BackEnd
from orbslam2py.slam.events import (
    Callbacks,
    Relocalized,
    TrackingLost,
)
from orbslam2py.slam.front_end import FrontEnd, Mask, PairMask
from orbslam2py.slam.full_bundle_adjustment import (
    FullAdjustmentOptions,
    FullAdjustmentRecord,
    check_time_limit,
)
from orbslam2py.slam.initialization import DepthInitializer
from orbslam2py.slam.localization_mode import LocalizationSwitch
from orbslam2py.slam.monocular_initialization import MonocularInitializer
from orbslam2py.slam.records import TrackingRecord, TrackingState
from orbslam2py.slam.relocalization import Relocalizer
from orbslam2py.slam.system_results import SystemResults
from orbslam2py.slam.timing import StageStatistics, StageTimer
from orbslam2py.slam.tracking import Tracking
from orbslam2py.slam.tracking_types import TrackingOutcome
from orbslam2py.slam.worker import CallGuard
from orbslam2py.trajectory.trajectory import Trajectory
from orbslam2py.vocabulary.vocabulary import load_vocabulary

_log = logging.getLogger(__name__)

#: Seconds that a reset or a shutdown waits for a worker before it says who is late.
_PATIENCE = 60.0


class System(SystemResults):
    """Visual SLAM for one camera, a stereo pair or an RGB-D camera.

    Parameters
    ----------
    settings : Settings or str or path
        Calibration and extractor settings: an object, the name of a built-in (``"tum1"``,
        ``"kitti04-12"``, ``"euroc"``...), or a file in the ORB-SLAM YAML format.
    sensor : Sensor or str
        ``"mono"``, ``"stereo"`` or ``"rgbd"``.
    vocabulary : Vocabulary or path, optional
        Visual words; the one shipped with the package if None.
    deterministic : bool
        Run mapping and loop closing inline after each keyframe: two runs give the same bytes.
    wait_for_mapping : bool
        For recorded data: a track call waits until at most one keyframe waits for mapping (with a
        single camera: until mapping is idle), so that mapping keeps up however fast the images are
        delivered. With a stereo or RGB-D sensor the result still depends a little on the timing of
        the threads; `deterministic` does not. For live cameras leave it off.
    loop_closing : bool
        Recognise places seen before and take out the drift.
    full_adjustment : bool
        After every loop, refine the whole map in a thread of its own.
    full_adjustment_time_limit : float, optional
        Seconds after which a full adjustment ends with what it has reached. Not in deterministic
        mode, whose results must not depend on the clock.
    callbacks : Callbacks, optional
        Functions that are told of loops, keyframes, losses and changes of the map.
    seed : int
        Seed of all random draws.

    Raises
    ------
    SettingsError, VocabularyError
        If these cannot be read or are inconsistent; no thread is left running.

    Examples
    --------
    >>> with System("tum1", "rgbd") as slam:  # doctest: +SKIP
    ...     record = slam.track_rgbd(image, depth, timestamp)
    ...     print(record.state, record.T_wc)
    """

    def __init__(
        self,
        settings: Settings | str | Path,
        sensor: Sensor | str,
        vocabulary: core.Vocabulary | str | Path | None = None,
        *,
        deterministic: bool = False,
        wait_for_mapping: bool = False,
        loop_closing: bool = True,
        full_adjustment: bool = True,
        full_adjustment_time_limit: float | None = None,
        callbacks: Callbacks | None = None,
        seed: int = 0,
    ) -> None:
        check_time_limit(full_adjustment_time_limit, deterministic=deterministic)
        self.sensor = Sensor(sensor)
        self.settings = settings = resolve_settings(settings, self.sensor)
        if not isinstance(vocabulary, core.Vocabulary):
            vocabulary = load_vocabulary(vocabulary)
        self.vocabulary = vocabulary
        self.deterministic = deterministic
        self.seed = seed
        self._wait_for_mapping = wait_for_mapping and not deterministic

        self._front_end = FrontEnd(settings, self.sensor)
        self._back_end = back_end = BackEnd(
            self.sensor,
            loop_closing=loop_closing,
            adjustment=FullAdjustmentOptions(
                enabled=full_adjustment, time_limit=full_adjustment_time_limit
            ),
            callbacks=callbacks or Callbacks(),
            seed=seed,
            threaded=not deterministic,
        )
        self._map, self._mapping = back_end.map, back_end.mapping
        self._tracking = Tracking(
            self._map,
            vocabulary,
            self._mapping,
            self.sensor,
            settings.max_keyframe_interval,
            initializer=self._initializer(),
            relocalizer=Relocalizer(self._map, back_end.index, seed),
        )
        self._localization = LocalizationSwitch(
            self._map, 1 if self.sensor.has_depth else 2, self._tracking, back_end.map_workers
        )
        self._recorder = core.TrajectoryRecorder()
        # Trajectories may be asked for in any thread, also while a frame is recorded.
        self._trajectory_lock = threading.Lock()
        self._finished_trajectories: list[Trajectory] = []
        self._statistics = StageStatistics()
        self._guard = CallGuard("tracking")
        self._reset_requested = threading.Event()
        self._next_frame_id = 0
        self._last_timestamp = -math.inf
        self._shut_down = False
        self.n_resets = 0

        # Everything refers to everything it needs before the first thread runs.
        for worker in back_end.workers:
            worker.start()
        self._finalizer = weakref.finalize(self, _abandon, back_end)

    # ---- tracking --------------------------------------------------------------------------------
    def track_stereo(
        self,
        left: npt.NDArray[np.uint8],
        right: npt.NDArray[np.uint8],
        timestamp: float,
        *,
        mask: PairMask | None = None,
        details: bool = False,
    ) -> TrackingRecord:
        """Track one rectified, synchronised stereo pair.

        Parameters
        ----------
        left, right : array of uint8, (h, w) or (h, w, 3) or (h, w, 4)
            Grey or colour (order by ``Camera.RGB`` of the settings), equal size.
        timestamp : float
            Seconds; must grow from call to call.
        mask : array of uint8 (h, w), or two of them (left, right), optional
            No keypoint lies where it is 0; one array serves both images.
        details : bool
            Also return the frame's keypoints and matches.

        Returns
        -------
        TrackingRecord
            State and, if it is OK, the pose of the left camera.

        Raises
        ------
        StateError
            For another sensor, after shutdown, or while another call runs.
        ImageError
            For bad images or time stamps; the frame is not counted and nothing has changed.
        WorkerError
            If a worker has failed; the original exception is its cause.
        """
        self._require(Sensor.STEREO, "track_stereo")
        return self._track(
            timestamp,
            details,
            lambda i, timer: self._front_end.stereo(left, right, i, timestamp, timer, mask),
        )

    def track_rgbd(
        self,
        image: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.generic],
        timestamp: float,
        *,
        mask: Mask | None = None,
        details: bool = False,
    ) -> TrackingRecord:
        """Track one image with registered depth.

        Parameters
        ----------
        image : array of uint8, (h, w) or (h, w, 3) or (h, w, 4)
            Grey or colour (order by ``Camera.RGB`` of the settings).
        depth : array, (h, w)
            Raw depth; divided by ``DepthMapFactor`` it is metres. 0, negative or NaN: unknown.
        timestamp : float
            Seconds; must grow from call to call.
        mask : array of uint8 (h, w), optional
            No keypoint lies where it is 0.
        details : bool
            Also return the frame's keypoints and matches.

        Returns
        -------
        TrackingRecord
            State and, if it is OK, the pose of the colour camera.

        Raises
        ------
        StateError, ImageError, WorkerError
            As for `track_stereo`.
        """
        self._require(Sensor.RGBD, "track_rgbd")
        return self._track(
            timestamp,
            details,
            lambda i, timer: self._front_end.rgbd(image, depth, i, timestamp, timer, mask),
        )

    def track_monocular(
        self,
        image: npt.NDArray[np.uint8],
        timestamp: float,
        *,
        mask: Mask | None = None,
        details: bool = False,
    ) -> TrackingRecord:
        """Track one image of a single camera.

        Parameters
        ----------
        image : array of uint8, (h, w) or (h, w, 3) or (h, w, 4)
            Grey or colour (order by ``Camera.RGB`` of the settings).
        timestamp : float
            Seconds; must grow from call to call.
        mask : array of uint8 (h, w), optional
            No keypoint lies where it is 0.
        details : bool
            Also return the frame's keypoints and matches.

        Returns
        -------
        TrackingRecord
            State and, if it is OK, the pose of the camera. The unit of length is the median depth
            of the first view; until the map begins, `TrackingRecord.reason` tells what it waits
            for.

        Raises
        ------
        StateError, ImageError, WorkerError
            As for `track_stereo`.
        """
        self._require(Sensor.MONOCULAR, "track_monocular")
        return self._track(
            timestamp,
            details,
            lambda i, timer: self._front_end.monocular(
                image, i, timestamp, timer, mask, initializing=self._tracking.initializing
            ),
        )

    def _initializer(self) -> DepthInitializer | MonocularInitializer:
        if self.sensor is Sensor.MONOCULAR:
            return MonocularInitializer(self._map, self.vocabulary, self._mapping, self.seed)
        return DepthInitializer(self._map, self.vocabulary, self._mapping)

    def _require(self, sensor: Sensor, call: str) -> None:
        if self.sensor is not sensor:
            raise StateError(
                f"{call} needs a system built for sensor '{sensor.value}', "
                f"this one is for '{self.sensor.value}'"
            )

    def _track(
        self,
        timestamp: float,
        details: bool,
        build: Callable[[int, StageTimer], core.Frame],
    ) -> TrackingRecord:
        with self._guard():
            if self._shut_down:
                raise StateError("the system has been shut down; make a new one")
            for worker in self._back_end.workers:
                worker.raise_if_failed()
            if self._reset_requested.is_set():
                self._reset_now()
            self._check_timestamp(timestamp)
            self._localization.apply()
            timer = StageTimer()
            if self._wait_for_mapping:
                with timer("wait"):
                    self._wait_for_mapper()
            before = self._tracking.state
            with timer("track"):
                frame = core.TrackedFrame(build(self._next_frame_id, timer))
                # From here on the image counts: every id is one image.
                self._next_frame_id += 1
                self._last_timestamp = timestamp
                outcome = self._tracking.track(frame, timer)
            self._statistics.add(timer.milliseconds)
            record = self._record(frame, outcome, timer, details)
            self._announce(before, record)
            self._mapping.start()
            return record

    def _announce(self, before: TrackingState, record: TrackingRecord) -> None:
        events = self._back_end.events
        where = record.map_index, record.frame_id, record.timestamp
        if before is TrackingState.OK and record.state is TrackingState.LOST:
            events.post(events.callbacks.on_lost, TrackingLost(*where, str(record.reason)))
        elif before is TrackingState.LOST and record.T_wc is not None:
            events.post(events.callbacks.on_relocalized, Relocalized(*where, record.T_wc))

    def _wait_for_mapper(self) -> None:
        if self.sensor.has_depth:
            self._mapping.worker.wait_until_waiting(at_most=1)
        elif not self._mapping.worker.held:
            self._mapping.worker.wait_until_waiting(at_most=0)
            # New points of a single camera come from mapping alone, and a busy mapper takes no
            # keyframes: on fast motion the map would end before the mapper is done.
            self._mapping.worker.wait_until_idle()

    def _check_timestamp(self, timestamp: float) -> None:
        if not math.isfinite(timestamp):
            raise ImageError(f"the time stamp must be a finite number of seconds, got {timestamp}")
        if timestamp <= self._last_timestamp:
            raise ImageError(
                f"time stamps must grow: {timestamp!r} came after {self._last_timestamp!r}"
            )

    def _record(
        self,
        frame: core.TrackedFrame,
        outcome: TrackingOutcome,
        timer: StageTimer,
        details: bool,
    ) -> TrackingRecord:
        ok = outcome.state is TrackingState.OK
        initialized = outcome.state in (TrackingState.OK, TrackingState.LOST)
        if outcome.reset_needed:
            _log.info("lost soon after initialization; starting a new map")
            self._reset_requested.set()
        elif initialized:
            with self._trajectory_lock:
                self._recorder.record(self._map, frame, lost=not ok)
        map_index = len(self._finished_trajectories)
        return TrackingRecord(
            frame_id=frame.id,
            timestamp=frame.timestamp,
            map_index=map_index,
            state=outcome.state,
            reason=outcome.reason,
            T_cw=frame.T_cw.matrix if ok and frame.T_cw is not None else None,
            covariance=outcome.covariance if ok else None,
            n_matches=outcome.n_matches,
            n_inliers=outcome.n_inliers if ok else 0,
            is_keyframe=outcome.is_keyframe,
            reference_keyframe=self._tracking.reference_keyframe,
            visual_odometry=outcome.visual_odometry,
            milliseconds=timer.milliseconds,
            features=frame_features(frame) if details else None,
        )

    # ---- control ---------------------------------------------------------------------------------
    @property
    def localization_mode(self) -> bool:
        """Pose only, in the map as it is: no keyframes, no new points, mapping paused.

        Assign to switch; carried out at the beginning of the next track call, and the last
        assignment before it counts. Leaving the map, the camera is followed by the depths of the
        frame before (stereo, RGB-D) until a mapped place comes into view again. Keyframes that wait
        for mapping are processed when it goes on. Without a map, also after a reset, the mode comes
        into force when one has begun.
        """
        return self._localization.wanted

    @localization_mode.setter
    def localization_mode(self, wanted: bool) -> None:
        self._localization.wanted = bool(wanted)

    def reset(self) -> None:
        """Ask for a new map; carried out at the beginning of the next track call.

        Settings, vocabulary and mode stay. The trajectory of the present map is kept, see
        `trajectories`.
        """
        self._reset_requested.set()

    def _reset_now(self) -> None:
        _log.info("resetting: map %d ends", len(self._finished_trajectories))
        self._back_end.reset(_PATIENCE, keep=self._keep_trajectory)
        self._tracking.reset()
        self._next_frame_id = 0
        self._last_timestamp = -math.inf
        self._reset_requested.clear()
        self.n_resets += 1

    def _keep_trajectory(self) -> None:
        with self._trajectory_lock:
            self._finished_trajectories.append(frame_trajectory(self._recorder, self._map))
            self._recorder.clear()

    def optimize(self) -> FullAdjustmentRecord:
        """Refine all keyframes and points together, now (full bundle adjustment).

        Tracking may go on meanwhile. A Ctrl-C gives up and leaves the map as it was; so do a loop
        that is closed meanwhile, another call, a reset, the shutdown and a switch to localization
        mode.

        Returns
        -------
        FullAdjustmentRecord
            Size, cost before and after, and whether the result was used.

        Raises
        ------
        StateError
            In localization mode, where the map is not to change.
        WorkerError
            If a worker has failed.
        """
        if self._localization.wanted or self._tracking.localization_only:
            raise StateError("optimize changes the map; switch localization mode off first")
        adjustment = self._back_end.adjustment
        if adjustment.worker.ended:
            return adjustment.run()
        return adjustment.start_and_wait()

    def wait_until_idle(self, timeout: float | None = None) -> bool:
        """Wait until every keyframe has been processed, and full adjustments have ended.

        Returns
        -------
        bool
            False when `timeout` seconds passed first, or keyframes wait for the end of localization
            mode.
        """
        return self._back_end.wait_until_idle(timeout)

    def shutdown(
        self,
        *,
        drain: bool = True,
        wait_for_adjustment: bool = False,
        timeout: float | None = None,
    ) -> None:
        """Stop the workers and join their threads; idempotent, to be repeated after a time-out.

        Results remain available. Also called at the end of a ``with`` block.

        Parameters
        ----------
        drain : bool
            Let waiting keyframes be processed first.
        wait_for_adjustment : bool
            Let a running full adjustment end as well; otherwise it is given up, and the map stays
            as it was before it.
        timeout : float, optional
            Seconds to wait for each worker.

        Raises
        ------
        WorkerError
            If a worker has failed, or does not end in time.
        """
        self._shut_down = True
        if not self._finalizer.alive:
            return
        if drain:
            self._localization.release()
        errors = self._back_end.finish(
            drain=drain, wait_for_adjustment=wait_for_adjustment, timeout=timeout
        )
        # Only now: should a Ctrl-C come before, the threads are still ended with the interpreter.
        if all(worker.ended for worker in self._back_end.workers):
            self._finalizer.detach()
        if errors:
            raise errors[0]

    def __enter__(self) -> System:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.shutdown(drain=error is None)
        except Exception:
            if error is None:
                raise
            if not isinstance(error, WorkerError):  # else it is the same one
                _log.exception("shutdown after an error failed as well")


def _abandon(back_end: BackEnd) -> None:
    """End the threads of a system that was dropped without shutdown."""
    for error in back_end.finish(drain=False, wait_for_adjustment=False, timeout=_PATIENCE):
        _log.error("while a system was dropped", exc_info=error)
