# SPDX-License-Identifier: BSD-3-Clause
"""Run the system over a recorded sequence, or on a camera."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from typing import Any, cast

import numpy as np

from orbslam2py import _core as core
from orbslam2py._files import describe_error
from orbslam2py._timing import StageStatistics
from orbslam2py.datasets.base import Images, Layout, LiveSource, Sequence
from orbslam2py.errors import DatasetError, ImageError, MapFileError, OrbSlamError
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.runs.calibration_watch import CalibrationWatch, come_raw, settings_beside
from orbslam2py.runs.control import RunControl
from orbslam2py.runs.feeds import FedFrame, LiveFeed, RecordedFeed, is_sequence
from orbslam2py.runs.imu import find_imu, imu_entry
from orbslam2py.runs.kept_images import KeptImages
from orbslam2py.runs.latency import latency_of
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.result import DROPPED, FrameRow, RunResult
from orbslam2py.settings.depth_check import doubt_of_tum_factor
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.inertial.map_moves import in_last_world
from orbslam2py.slam.records import PoseMethod, TrackingRecord
from orbslam2py.slam.system import System
from orbslam2py.trajectory.trajectory import Trajectory

_log = logging.getLogger(__name__)

#: Seconds between two looks at whether to stop.
_WAIT_SLICE = 0.2
#: Seconds that an image of a camera waits for the samples of the IMU up to its time.
_IMU_PATIENCE = 0.1

#: Called after every frame with the row and the system.
Progress = Callable[[FrameRow, System], None]

#: Called with the system before the first frame; what it returns is entered then, and left when the
#: system has been shut down.
Watch = Callable[[System], AbstractContextManager[object]]


class SequenceRunner:
    """Feeds the images of a sequence or a camera to a `System` and collects the results.

    Ctrl-C, or a failure, ends the run early; the result contains what was computed.

    Parameters
    ----------
    sequence : Sequence or LiveSource
        Images and time stamps.
    settings : Settings
        For the system.
    vocabulary : Vocabulary
        For the system.
    options : RunOptions
        Which frames, and how.
    """

    def __init__(
        self,
        sequence: Sequence | LiveSource,
        settings: Settings,
        vocabulary: core.Vocabulary | None,
        options: RunOptions,
    ) -> None:
        self._vocabulary = vocabulary
        self._options = options
        self._watch: CalibrationWatch | None = None
        self._latency = StageStatistics()
        self._feed: RecordedFeed | LiveFeed
        self._imu = find_imu(
            sequence,
            options.imu,
            options.imu_settings,
            options.imu_samples,
            is_live=not is_sequence(sequence),
        )
        if is_sequence(sequence):
            indices = options.indices(len(sequence))
            self._feed = RecordedFeed(sequence, indices, realtime=options.realtime, imu=self._imu)
        else:
            options.check_for_camera()
            self._feed = LiveFeed(cast(LiveSource, sequence), options.max_frames)
        self.result = RunResult(
            sequence=sequence,
            settings=settings,
            options=options,
            n_frames=self._feed.n_frames,
            is_live=self._feed.is_live,
            kept_images=KeptImages(settings) if self._feed.is_live else None,
        )

    def run(
        self,
        progress: Progress | None = None,
        stop: threading.Event | None = None,
        *,
        control: RunControl | None = None,
        watch: Watch | None = None,
    ) -> RunResult:
        """Process the frames.

        Parameters
        ----------
        progress : callable, optional
            Called after every frame.
        stop : threading.Event, optional
            An event that ends the run after the present frame when set; a camera's run ends only by
            it, or by `RunOptions.max_frames`.
        control : RunControl, optional
            Instead of `stop`: can also pause the run and process single frames.
        watch : callable, optional
            Called with the system; the context manager that it returns is entered before the first
            frame, and left after the shutdown of the system. For viewers, recordings, videos.

        Returns
        -------
        RunResult
            Also if the run was stopped, also by Ctrl-C, or failed: see `RunResult.interrupted` and
            `RunResult.error`.
        """
        result, options = self.result, self._options
        begin = time.perf_counter()
        result.started = datetime.now().astimezone().isoformat(timespec="seconds")
        in_time = options.realtime or self._feed.is_live
        # The watch below checks the calibration: it knows more.
        how = replace(options.system, wait_for_mapping=not in_time, check_calibration=False)
        self._watch = self._calibration_watch(
            in_background=in_time or not options.system.deterministic
        )
        system = System(
            result.settings,
            options.sensor,
            self._vocabulary,
            load_map=options.load_map,
            initial_pose=options.initial_pose,
            allow_other_setup=options.allow_other_setup,
            imu=None if self._imu is None else self._imu.settings,
            **asdict(how),
        )
        if options.save_map is not None and options.autosave is not None:
            system.autosave(options.save_map, options.autosave)
        control = control or RunControl(stop)
        stop = control.stop
        with contextlib.ExitStack() as watching:
            try:
                if watch is not None:
                    watching.enter_context(watch(system))
                self._process(system, progress, control)
                self._wait_for_mapping(system, stop)
                self._adjust_finished_map(system, stop)
            except KeyboardInterrupt:
                stop.set()
            except Exception as error:
                self._take_note(error)
            result.interrupted = stop.is_set() and not result.is_live
            if result.interrupted:
                seen = f"{len(result.rows)} of {result.n_frames} frames"
                _log.warning("interrupted; saving the results so far (%s)", seen)
            self._shut_down(system)
        self._save_map(system)
        result.warnings += getattr(result.sequence, "doubts", ())  # logged when it was opened
        result.warnings += system.settings.doubts()  # which the system has logged
        self._judge_depth(system)
        if self._imu is not None:
            result.imu_settings = self._imu.settings
        if system.imu_check is not None:
            result.warnings += [fault.text for fault in system.imu_check.faults]
        result.calibration_warnings = self._calibration_warnings(system)
        result.warnings += result.calibration_warnings
        self._collect(system)
        result.alignment = self._alignment_entry(system)
        if system.imu_check is not None:
            n_samples = system.pipeline.inertial.n_samples
            metric = system.pipeline.back_end.map.is_upright(result.main_map)
            result.imu = imu_entry(system.imu_check, n_samples, metric=metric)
        result.seconds = time.perf_counter() - begin
        return result

    def _alignment_entry(self, system: System) -> dict[str, Any] | None:
        """Return the noise of aligned sightings; None where nothing is aligned."""
        pipeline = system.pipeline
        if not pipeline.alignment.uses_points:
            return None
        noise, right_noise = core.alignment_noise(pipeline.back_end.map)
        records = [row.record for row in self.result.rows if row.record is not None]
        followed = sum(record.method is PoseMethod.PATCHES for record in records)
        return {
            "noise_px": noise,
            "right_noise_px": right_noise,
            "frames_without_features": followed,
        }

    def _judge_depth(self, system: System) -> None:
        """Store the depth, and warn of a factor that is only the default of another data set."""
        result = self.result
        result.median_depth = system.pipeline.front_end.depth_check.median
        if result.sequence.layout == Layout.TUM:
            return
        doubt = doubt_of_tum_factor(result.settings.depth_factor, result.median_depth)
        if doubt is not None:
            _log.warning("%s", doubt)
            result.warnings.append(doubt)

    def _calibration_watch(self, *, in_background: bool) -> CalibrationWatch | None:
        if not self._options.system.check_calibration:
            return None
        return CalibrationWatch(
            self.result.settings,
            self._options.sensor,
            known=settings_beside(self.result.sequence),
            in_background=in_background,
            raw_pairs=come_raw(self.result.settings),
        )

    def _calibration_warnings(self, system: System) -> list[str]:
        misfit = None if self._watch is None else self._watch.finish()
        found = [None if misfit is None else str(misfit), system.pipeline.front_end.depth_warning]
        return [warning for warning in found if warning is not None]

    # ---- one pass over the frames ----------------------------------------------------------------
    def _process(self, system: System, progress: Progress | None, control: RunControl) -> None:
        result, stop = self.result, control.stop
        try:
            control.wait()
            with contextlib.closing(self._feed.frames(stop)) as frames:
                for position, frame in enumerate(frames):
                    if position == self._options.localize_after:
                        # The map must be complete, at any speed of mapping.
                        self._wait_for_mapping(system, stop)
                        system.localization_mode = True
                    row = self._track(system, frame)
                    result.rows.append(row)
                    if progress is not None:
                        progress(row, system)
                    self._feed.delay(control.wait())
        finally:
            if result.is_live:
                result.n_frames = len(result.rows)
                result.n_lost_by_camera = self._feed.n_lost
                counts = getattr(result.sequence, "counts", None)
                result.input_counts = counts() if callable(counts) else None

    def _track(self, system: System, frame: FedFrame) -> FrameRow:
        imu = None if self._imu is None else frame.imu
        if imu is not None:
            # Of every frame, also of those that are not tracked.
            system.add_imu(imu)
        if frame.is_dropped:
            return _row(frame, None, DROPPED)
        if isinstance(frame.item, Exception):
            if not isinstance(frame.item, (OrbSlamError, OSError)):
                raise frame.item
            return self._skip(frame, frame.item)
        if imu is not None and self._feed.is_live:
            system.wait_for_imu(frame.timestamp, _IMU_PATIENCE)
        begin = time.perf_counter()
        try:
            record = self._call(system, frame.item, frame.timestamp)
        except ImageError as error:
            return self._skip(frame, error, self._file_of(frame))
        finally:
            self.result.slam_seconds += time.perf_counter() - begin
        latency = None if frame.times is None else latency_of(frame.times, time.monotonic())
        if latency is not None:
            self._latency.add(latency)
        if self._watch is not None:
            self._watch.look(frame.item)
        if self.result.kept_images is not None:
            self.result.kept_images.look(len(self.result.rows), frame.item.image, record)
        return replace(_row(frame, record, str(record.reason)), latency=latency)

    def _call(self, system: System, images: Images, timestamp: float) -> TrackingRecord:
        sensor = self._options.sensor
        second: Any = images.right if sensor is Sensor.STEREO else images.depth
        if sensor is Sensor.RIG:
            second = images.cameras
        if second is None and sensor is not Sensor.MONOCULAR:
            # Not a spoilt frame, which is skipped: all others lack it, too.
            raise DatasetError("the sequence delivers no second image for this sensor")
        return system.track(images, timestamp)

    def _skip(self, frame: FedFrame, error: Exception, file: str = "") -> FrameRow:
        reason = describe_error(error)
        told = f"{reason} (it is {file})" if file else reason
        _log.warning("frame %d skipped: %s", frame.index, told)
        return _row(frame, None, reason)

    def _file_of(self, frame: FedFrame) -> str:
        """Return the file of a frame's image; empty if unknown."""
        path_of = getattr(self.result.sequence, "image_path", None)
        # A user's sequence may have another attribute of that name.
        place = path_of(frame.index) if callable(path_of) else None
        return str(place) if isinstance(place, Path) else ""

    # ---- the end ---------------------------------------------------------------------------------
    def _wait_for_mapping(self, system: System, stop: threading.Event) -> None:
        begin = time.perf_counter()
        idle = False
        while not (idle or stop.is_set() or system.localization_mode):
            idle = system.wait_until_idle(_WAIT_SLICE)
        self.result.slam_seconds += time.perf_counter() - begin

    def _adjust_finished_map(self, system: System, stop: threading.Event) -> None:
        # Ctrl-C is how a camera's run ends; the results of others are needed immediately.
        ended = stop.is_set() and not self.result.is_live
        if self._options.final_adjustment and system.n_keyframes > 0 and not ended:
            give_up = threading.Event() if self.result.is_live else stop
            main = main_map(system, system.trajectories())
            self.result.final_adjustment = system.optimize(stop=give_up, map_index=main)

    def _shut_down(self, system: System) -> None:
        try:
            system.shutdown(drain=not self.result.interrupted and self.result.error is None)
        except Exception as error:
            self.result.last_save_failed = isinstance(error, MapFileError)
            if self.result.error is None:
                self._take_note(error)

    def _save_map(self, system: System) -> None:
        path = self._options.save_map
        if path is None or self.result.last_save_failed:
            return
        if system.n_keyframes == 0:
            _log.warning("there is no map to save: %s is not written", path)
            return
        try:
            if self._options.autosave is None:
                system.save_map(path)
            self.result.saved_map = path
        except Exception as error:
            self.result.last_save_failed = True
            if self.result.error is None:
                self._take_note(error)

    def _take_note(self, error: Exception) -> None:
        self.result.error = error
        if not isinstance(error, OrbSlamError):
            _log.error("unexpected error; please report it", exc_info=error)
        elif self.result.command is None:  # the command reports the results of its run
            _log.warning("the run failed: %s", describe_error(error))

    def _collect(self, system: System) -> None:
        result = self.result
        trajectories = system.trajectories()
        result.main_map = main = main_map(system, trajectories)
        result.maps = system.maps
        by_frame: dict[tuple[int, int], int] = {}
        by_time: dict[float, int] = {}
        for position, row in enumerate(result.rows):
            if row.record is not None:
                by_frame[row.record.map_index, row.record.frame_id] = position
                # Of equal times that of the main map counts.
                if row.record.map_index == main or row.record.timestamp not in by_time:
                    by_time[row.record.timestamp] = position
        # A map may contain earlier frames, if an earlier map was dropped.
        self._move_earlier_poses(system)
        result.trajectories = [
            _renumber(
                t,
                [
                    by_frame.get((number, int(i)), by_time.get(float(seconds), -1))
                    for i, seconds in zip(t.indices, t.timestamps, strict=True)
                ],
            )
            for number, t in enumerate(trajectories)
        ]
        keyframes = system.keyframe_trajectory(main)
        result.keyframes = _renumber(
            keyframes, [by_time.get(float(t), -1) for t in keyframes.timestamps]
        )
        result.snapshot = system.map_snapshot(main)
        result.other_maps = [one for one in system.map_snapshots() if one.map_index != main]
        seen = core.snapshot_observations(system.pipeline.back_end.map, main)
        points = np.repeat(seen.ids, np.diff(seen.offsets))
        result.sightings = np.stack([points, seen.keyframes], axis=1)
        result.drawing = MapArrays.of(system.pipeline.back_end.map, main)
        result.stages = system.stage_statistics() | self._latency.summary()
        result.n_resets = system.n_resets
        result.n_relocalizations = system.n_relocalizations
        result.loops = system.loops
        result.merges = system.merges
        result.full_adjustments = system.full_adjustments

    def _move_earlier_poses(self, system: System) -> None:
        """Give the poses from before the IMU turned a map upright in the world of the map."""
        tracker = system.pipeline.inertial_tracker
        if tracker is None or not tracker.map_moves:
            return
        self.result.rows = [
            row
            if row.record is None
            else replace(row, record=in_last_world(row.record, tracker.map_moves))
            for row in self.result.rows
        ]


def main_map(system: System, trajectories: list[Trajectory]) -> int:
    """Choose the map of the figures of a run: see `RunResult.main_map`."""
    last = len(trajectories) - 1
    if not system.options.several_maps:
        return last
    n_tracked = {
        there.map_index: int(np.count_nonzero(~trajectories[there.map_index].lost))
        for there in system.maps
    }
    return max(n_tracked, key=lambda index: (n_tracked[index], -index), default=last)


def _renumber(trajectory: Trajectory, positions: list[int]) -> Trajectory:
    """Give every pose the position of its row; after an interrupt a pose may have none."""
    indices = np.array(positions, np.int64)
    return replace(trajectory, indices=indices).select(indices >= 0)


def _row(frame: FedFrame, record: TrackingRecord | None, reason: str) -> FrameRow:
    return FrameRow(frame.index, frame.text, record, reason)
