# SPDX-License-Identifier: BSD-3-Clause
"""The interface for users: images in, poses and a map out."""

from __future__ import annotations

import logging
import threading
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arguments import (
    choice_of,
    finite_number,
    is_whole,
    path_of,
    patience_of,
    shown,
)
from orbslam2py._call_guard import CallGuard
from orbslam2py.errors import MapFileError, StateError, WorkerError
from orbslam2py.inertial.samples import ImuSamples
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.map_writer import check_map_target
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.maps.snapshot import (
    MapSnapshot,
    keyframe_trajectory,
    take_snapshot,
    take_snapshots,
)
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.back_end import abandon
from orbslam2py.slam.config import Config
from orbslam2py.slam.effort import Effort
from orbslam2py.slam.events import Callbacks, LoopClosed, MapsMerged
from orbslam2py.slam.frame_source import FrameSource, SomeImages, arrays_of, timed_images
from orbslam2py.slam.front_end import Mask, PairMask
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord
from orbslam2py.slam.inertial import ImuCheck
from orbslam2py.slam.options import Setup, SystemOptions
from orbslam2py.slam.pipeline import Pipeline
from orbslam2py.slam.records import MapSummary, TrackingRecord, TrackingState
from orbslam2py.slam.rig_front_end import RigFrontEnd
from orbslam2py.trajectory.trajectory import Trajectory

_log = logging.getLogger(__name__)


class System:
    """Visual SLAM for one camera, a stereo pair, an RGB-D camera or a rig of several cameras.

    Parameters
    ----------
    settings : Settings or str or path
        Calibration and extractor settings: an object, the name of built-in settings (``"tum1"``,
        ``"kitti04-12"``, ``"euroc"``...), or a YAML file of ORB-SLAM. Not needed with `load_map`: a
        map file contains its own.
    sensor : Sensor or str
        ``"mono"``, ``"stereo"``, ``"rgbd"`` or ``"rig"``. Not needed with `load_map`.
    vocabulary : Vocabulary or path, optional
        Visual words; None: the vocabulary of the package.
    load_map : SavedMap, MapFile or path, optional
        Map file to begin in: tracking starts lost, and every image is searched in this map. It is
        dropped only by `reset`; another map may begin beside it.
    initial_pose : array (4, 4), optional
        Camera to world: likely pose of the camera in the loaded map; it is tried first until an
        image is found.
    allow_other_setup : bool
        Load the map even if it was made with another camera or vocabulary.
    deterministic : bool
        Run mapping and loop closing inline after each keyframe: two runs give the same bytes.
    wait_for_mapping : bool
        For recorded data: a track call waits until at most one keyframe waits for mapping. If the
        image may become a keyframe as soon as mapping is idle (with a single camera always), it
        waits until mapping is idle. So mapping keeps up at any speed of the images. With a stereo
        or RGB-D sensor the result still depends slightly on the timing of the threads; with
        `deterministic` it does not. Do not use it with live cameras.
    loop_closing : bool
        Close loops: recognise known places and correct the drift.
    full_adjustment : bool
        Run full bundle adjustment after every loop, in a separate thread.
    full_adjustment_time_limit : float, optional
        Time limit of a full bundle adjustment in seconds; the result up to then is used. Not
        allowed in deterministic mode, whose results must not depend on the clock.
    callbacks : Callbacks, optional
        Functions that receive loops, keyframes, losses and changes of the map.
    keyframe_images : bool
        Store a small grey JPEG of every keyframe in map files.
    point_patches : bool
        Store the patches of points, a kilobyte each, and the sightings that were aligned to them,
        in map files, so that sightings of old points are aligned in a loaded map.
    seed : int
        Seed of all random numbers.
    several_maps : bool
        Begin another map if tracking is lost for long; the old one becomes inactive, but is still
        searched. Otherwise mapping stops until the camera sees the old map again.
    new_map_after : float
        Time between the loss and the start of another map, in seconds of the time stamps.
    effort : {"fast", "light", "normal", "thorough"}
        Amount of work for map and trajectory: ``fast`` makes fewer keyframes; ``light`` tracks one
        camera or RGB-D without features where patches of known points are enough; ``thorough``
        matches every frame with the map again after the map has settled, the last thousand in
        `shutdown`.
    config : Config or mapping, optional
        Changes of thresholds, by names with a dot: ``{"tracking.map_matches": 12}``; see
        `orbslam2py.slam.config`.
    imu : ImuSettings, str or path, optional
        The IMU beside the (left, unrectified) camera, or a file that `read_imu_settings` reads; by
        default the ``IMU.*`` keys of the settings file. Needed for `track` with samples and for
        `add_imu`.
    check_calibration : bool
        Log one warning if the calibration contradicts the size of the first image.
        `orbslam2py.check_calibration` also examines the images.

    Attributes
    ----------
    settings, sensor, vocabulary, options
        The options of the system.
    pipeline : Pipeline
        The parts of the system, for users who study or extend the method. They may change from
        version to version.

    Raises
    ------
    SettingsError, VocabularyError, MapFileError
        If the settings cannot be read or are inconsistent, or the loaded map has another camera,
        sensor or vocabulary; no thread is left running.

    Examples
    --------
    >>> with System("tum1", "rgbd") as slam:  # doctest: +SKIP
    ...     record = slam.track_rgbd(image, depth, timestamp)
    ...     print(record.state, record.T_wc)
    """

    def __init__(
        self,
        settings: Settings | str | Path | None = None,
        sensor: Sensor | str | None = None,
        vocabulary: core.Vocabulary | str | Path | None = None,
        *,
        load_map: SavedMap | MapFile | str | Path | None = None,
        initial_pose: npt.ArrayLike | None = None,
        allow_other_setup: bool = False,
        deterministic: bool = False,
        wait_for_mapping: bool = False,
        loop_closing: bool = True,
        full_adjustment: bool = True,
        full_adjustment_time_limit: float | None = None,
        callbacks: Callbacks | None = None,
        keyframe_images: bool = False,
        point_patches: bool = True,
        seed: int = 0,
        check_calibration: bool = True,
        several_maps: bool = True,
        new_map_after: float = 2.0,
        effort: Effort | str = Effort.NORMAL,
        config: Config | Mapping[str, Any] | None = None,
        imu: ImuSettings | str | Path | None = None,
    ) -> None:
        self.options = SystemOptions(
            deterministic=deterministic,
            wait_for_mapping=wait_for_mapping,
            loop_closing=loop_closing,
            full_adjustment=full_adjustment,
            full_adjustment_time_limit=full_adjustment_time_limit,
            keyframe_images=keyframe_images,
            point_patches=point_patches,
            seed=seed,
            check_calibration=check_calibration,
            several_maps=several_maps,
            new_map_after=new_map_after,
            effort=effort,  # type: ignore[arg-type]
            config={} if config is None else config,  # type: ignore[arg-type]
        )
        setup = Setup.of(
            settings, sensor, vocabulary, load_map, initial_pose, allow_other_setup, imu
        )
        self.sensor, self.settings, self.vocabulary = setup.sensor, setup.settings, setup.vocabulary
        for doubt in self.settings.doubts():
            _log.warning("%s", doubt)
        self.pipeline = Pipeline(setup, self.options, Callbacks.of(callbacks))
        self._guard = CallGuard("tracking")
        self._shut_down = False
        self.pipeline.start()
        self._finalizer = weakref.finalize(
            self, abandon, self.pipeline.back_end, self.pipeline.keeper
        )

    # ---- tracking --------------------------------------------------------------------------------
    def track(
        self,
        images: SomeImages | npt.NDArray[np.uint8] | Sequence[Any],
        timestamp: float,
        *,
        mask: PairMask | None = None,
        details: bool = False,
        imu: ImuSamples | npt.ArrayLike | None = None,
    ) -> TrackingRecord:
        """Track the images of one moment.

        Parameters
        ----------
        images : array, sequence of arrays, or images
            One camera: the image. Stereo: left and right, synchronised; raw ones are rectified by
            the settings. RGB-D: image and registered depth. Rig: one image for each camera in the
            order of the settings, (image, depth) for a camera with depth images, and None for one
            that gave nothing. Or `orbslam2py.datasets.Images` of a sequence.

            Images are uint8 (h, w), (h, w, 3) or (h, w, 4), grey or colour (order by ``Camera.RGB``
            of the settings). Depth is (h, w) of any number type; divided by ``DepthMapFactor`` it
            is in metres. Zero, negative, NaN and masked values are unknown.
        timestamp : float
            Seconds; must increase from call to call.
        mask : array of uint8 (h, w), or two of them (left, right), optional
            No keypoints are taken where the mask is 0; one array serves both images of a pair. Of a
            rig one mask, or None, for each camera.
        details : bool
            Also return the frame's keypoints and matches.
        imu : array of float64 (n, 7), optional
            Samples of an IMU since the image before, rows ``[t, gyro x, y, z, accelerometer x, y,
            z]``: seconds on the clock of the IMU, rad/s, m/s^2. A sample after the image helps to
            interpolate. They are compared with the path of the camera; a warning names their
            faults. Once they fit, they predict poses, and for up to 5 s replace those that images
            do not give. The call never waits for samples.

        Returns
        -------
        TrackingRecord
            State and, if it is OK, the pose of the left or single camera, of a rig that of its
            first one. With one camera the unit of length is the median depth of the first view.
            Before the map begins,
            `TrackingRecord.reason` says what is missing.

        Raises
        ------
        StateError
            After shutdown, or while another call runs.
        ImageError
            For bad or missing images and for bad time stamps; the frame is not counted and nothing
            has changed, except for a requested reset. Samples of the IMU wait for the next image
            then.
        DatasetError
            If the samples of the IMU have another shape; nothing has changed then.
        WorkerError
            If a worker has failed; its exception is the cause.
        """
        if imu is not None:
            self.pipeline.inertial.add(imu)
        first, second, own_mask = arrays_of(images, self.sensor, timestamp)
        chosen = own_mask if mask is None else mask
        if isinstance(self.pipeline.front_end, RigFrontEnd):
            cameras: Any = second
            first = self.pipeline.front_end.mosaic(cameras)

        with self._guard():
            if self._shut_down:
                raise StateError("the system has been shut down; make a new one")
            return self.pipeline.process(timestamp, first, second, chosen, details=details)

    def add_imu(self, samples: ImuSamples | npt.ArrayLike) -> None:
        """Add samples of an IMU when they arrive; they wait for the images that they belong to.

        May be called from any thread, also while an image is tracked. Samples that are late,
        repeated, not finite or out of order are left out or sorted; one warning says so.

        Parameters
        ----------
        samples : array of float64 (n, 7), or (7,)
            Rows as for `track`.

        Raises
        ------
        DatasetError
            If they have another shape; nothing has changed then.
        """
        self.pipeline.inertial.add(samples)

    def wait_for_imu(self, timestamp: float, timeout: float = 0.1) -> bool:
        """Wait until the samples of `add_imu` reach an image that is to be tracked next.

        Parameters
        ----------
        timestamp : float
            Of the image, seconds.
        timeout : float
            Seconds to wait at most; a warning says once that samples did not come.

        Returns
        -------
        bool
            Whether they came; Returns True immediately without IMU settings.
        """
        inertial = self.pipeline.inertial
        return inertial.settings is None or inertial.buffer.wait_for(timestamp, timeout)

    def track_stereo(
        self,
        left: npt.NDArray[np.uint8],
        right: npt.NDArray[np.uint8],
        timestamp: float,
        *,
        mask: PairMask | None = None,
        details: bool = False,
    ) -> TrackingRecord:
        """Track one rectified, synchronised stereo pair: `track` of ``(left, right)``.

        Raises
        ------
        StateError
            Also if the system has another sensor.
        """
        self._require(Sensor.STEREO, "track_stereo")
        return self.track((left, right), timestamp, mask=mask, details=details)

    def track_rgbd(
        self,
        image: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.generic],
        timestamp: float,
        *,
        mask: Mask | None = None,
        details: bool = False,
    ) -> TrackingRecord:
        """Track one image with registered depth: `track` of ``(image, depth)``.

        Raises
        ------
        StateError
            Also if the system has another sensor.
        """
        self._require(Sensor.RGBD, "track_rgbd")
        return self.track((image, depth), timestamp, mask=mask, details=details)

    def track_monocular(
        self,
        image: npt.NDArray[np.uint8],
        timestamp: float,
        *,
        mask: Mask | None = None,
        details: bool = False,
    ) -> TrackingRecord:
        """Track one image of a single camera: `track` of the image.

        Raises
        ------
        StateError
            Also if the system has another sensor.
        """
        self._require(Sensor.MONOCULAR, "track_monocular")
        return self.track(image, timestamp, mask=mask, details=details)

    def run(self, source: FrameSource, *, details: bool = False) -> list[TrackingRecord]:
        """Track all images of a sequence, and wait until their keyframes are processed.

        For recorded images create the system with `wait_for_mapping` or `deterministic`; otherwise
        mapping does not keep up. `orbslam2py.run_sequence` does more: it reads ahead, skips
        unreadable images, compares with ground truth and writes files.

        Parameters
        ----------
        source : sequence, or iterable of frames
            As from `orbslam2py.open_sequence`, or any iterable of frames with a ``timestamp`` and
            ``images``: a camera, ``itertools.islice(sequence, 100)``. A mask that comes with the
            images is used, and the samples of ``imu`` if the system knows the IMU.
        details : bool
            Also return the frames' keypoints and matches.

        Returns
        -------
        list of TrackingRecord
            One per image.

        Raises
        ------
        StateError, ImageError, WorkerError
            As for `track_stereo`; also if the source is for another sensor. The frames tracked
            before remain in the map and the trajectory.
        DatasetError
            If a file is missing.
        """
        with_imu = self.pipeline.inertial.settings is not None
        records = [
            self.track(one.images, one.timestamp, details=details, imu=one.imu)
            for one in timed_images(source, self.sensor, with_imu=with_imu)
        ]
        self.wait_until_idle()
        return records

    def _require(self, sensor: Sensor, call: str) -> None:
        if self.sensor is not sensor:
            raise StateError(
                f"{call} needs a system built for sensor '{sensor.value}', "
                f"this one is for '{self.sensor.value}'"
            )

    # ---- control ---------------------------------------------------------------------------------
    @property
    def localization_mode(self) -> bool:
        """Estimate poses in a fixed map: no keyframes, no new points, mapping paused.

        Assign to switch the mode. The switch happens at the beginning of the next track call; the
        last assignment before it counts. Outside the map, the pose follows the depths of the frame
        before (stereo, RGB-D) until a mapped place is in view again. Keyframes that wait for
        mapping are processed when mapping continues. Without a map, also after a reset, the mode
        begins as soon as there is a map. A value other than True or False raises `SettingsError`.
        """
        return self.pipeline.localization.wanted

    @localization_mode.setter
    def localization_mode(self, wanted: bool) -> None:
        self.pipeline.localization.wanted = choice_of(wanted, "localization_mode")

    def reset(self) -> None:
        """Request a new map; it begins with the next track call.

        Settings, vocabulary and mode are kept; the next images may have another size. The
        trajectory of the present map is kept: see `trajectories`.
        """
        self.pipeline.request_reset()

    def optimize(
        self, *, stop: threading.Event | None = None, map_index: int | None = None
    ) -> FullAdjustmentRecord:
        """Run full bundle adjustment of a map now: all keyframes and points together.

        Tracking may continue in parallel. Ctrl-C stops it and leaves the map as it was. A loop
        closure, another call, a reset, the shutdown and a switch to localization mode stop it too.

        Parameters
        ----------
        stop : threading.Event, optional
            An event that stops it when set, like Ctrl-C. In deterministic mode, nothing stops it
            after its start.
        map_index : int, optional
            Number of one of `maps`; None: the active one.

        Returns
        -------
        FullAdjustmentRecord
            Size, cost before and after, and whether the result was used.

        Raises
        ------
        StateError
            In localization mode, where the map must not change, or if an argument is invalid.
        IndexError
            If no map of that number has begun. A map that has been merged or dropped is not
            adjusted.
        WorkerError
            If a worker has failed.
        """
        self._check_map_index(map_index)
        if not (stop is None or callable(getattr(stop, "is_set", None))):
            raise StateError(f"stop is {shown(stop)}; give a threading.Event, or None")
        localization = self.pipeline.localization
        if localization.wanted or localization.on:
            raise StateError("optimize changes the map; switch localization mode off first")
        adjustment = self.pipeline.back_end.adjustment
        if adjustment.worker.ended:
            return adjustment.run(map_index)
        return adjustment.start_and_wait(stop, map_index)

    def wait_until_idle(self, timeout: float | None = None) -> bool:
        """Wait until every keyframe is processed and full bundle adjustments have ended.

        A pending loop is closed first, but not in localization mode.

        Returns
        -------
        bool
            False if `timeout` seconds are over first, or if keyframes wait for the end of
            localization mode.

        Raises
        ------
        StateError
            In a callback of deterministic mode, because the image waits for the callback; False if
            a time is given.
        """
        localization = self.pipeline.localization
        return self.pipeline.back_end.wait_until_idle(
            patience_of(timeout), close_loop=not (localization.wanted or localization.on)
        )

    def shutdown(
        self,
        *,
        drain: bool = True,
        wait_for_adjustment: bool = False,
        timeout: float | None = None,
    ) -> None:
        """Stop the workers and join their threads; further calls do nothing.

        Call it again after a time-out or Ctrl-C. Results remain available. Also called at the end
        of a ``with`` block. Of several errors, the first is raised and the others are logged.

        Parameters
        ----------
        drain : bool
            Process waiting keyframes first.
        wait_for_adjustment : bool
            Wait for a running full bundle adjustment too; otherwise it is stopped, and the map
            stays as it was before.
        timeout : float, optional
            Seconds to wait for each worker, and for a track call in another thread.

        Raises
        ------
        WorkerError
            If a worker has failed or does not end in time.
        MapFileError
            If the last autosave could not be written.
        """
        timeout = patience_of(timeout)
        self._shut_down = True
        if not self._finalizer.alive:
            return
        if drain:
            self.pipeline.localization.release()
        back_end = self.pipeline.back_end
        errors = back_end.finish(
            drain=drain, wait_for_adjustment=wait_for_adjustment, timeout=timeout
        )
        ended = all(worker.ended for worker in back_end.workers)
        if ended and not self._guard.wait_until_left(timeout):
            errors.append(WorkerError(f"tracking did not end within {timeout} s"))
            ended = False
        if ended:
            # No other thread moves the frames now.
            self.pipeline.recorder.settle()
        try:
            self.pipeline.keeper.stop_autosave()
        except MapFileError as unsaved:
            errors.append(unsaved)
        # Only now: should a Ctrl-C come before, the threads are still ended with the interpreter.
        if ended:
            self._finalizer.detach()
        # One error is raised; none of the others is to be lost.
        for further in errors[1:]:
            _log.error("shutdown failed otherwise as well: %s", further, exc_info=further)
        if errors:
            raise errors[0]

    # ---- map files -------------------------------------------------------------------------------
    def save_map(self, path: str | Path) -> None:
        """Save the present map; from any thread, also during tracking.

        Parameters
        ----------
        path : str or path
            The file, by custom with the suffix ``.orbmap``. It gets this name only after it is
            complete. If it is the file of `autosave`, this file is updated; after a `reset` its
            name is ``<name>-1.orbmap``, and the file of the map before is kept.

        Raises
        ------
        MapFileError
            If the map has no keyframes yet, or the file cannot be written; an existing file is
            kept.
        """
        self.pipeline.keeper.save(path)

    def autosave(self, path: str | Path, every: float = 10.0) -> None:
        """Update a map file regularly from now on; only changes are written.

        However the program ends, the file is valid and contains the map of the last save.
        `shutdown` saves once more. After a `reset` the new map is saved beside it, as
        ``<name>-1.orbmap``.

        Parameters
        ----------
        path : str or path
            The file; the first save, after `every` seconds, replaces it.
        every : float
            Seconds from one save to the next.

        Raises
        ------
        MapFileError
            If no map can be written there.
        StateError
            If `every` is not above 0, or the system has been shut down.
        """
        if self._shut_down:
            raise StateError("the system has been shut down; save its map with save_map")
        target = path_of(path, "path", MapFileError)
        seconds = finite_number(every, "every", "seconds, more than 0", StateError)
        check_map_target(target)
        self.pipeline.keeper.autosave(target, seconds)

    def saved_map(self) -> SavedMap:
        """Return all that `save_map` would write now."""
        return self.pipeline.keeper.saved_map()

    def map_contents(self) -> MapContents:
        """Return all data of the map as arrays; may be called while the system runs."""
        return self.pipeline.keeper.contents()

    @property
    def imu_check(self) -> ImuCheck | None:
        """Whether the IMU fits the camera, by the samples so far; None without IMU settings.

        `ImuCheck.verdict` is unknown at first; `ImuCheck.reason` says why its use is held back.
        """
        return self.pipeline.inertial.check

    # ---- results ---------------------------------------------------------------------------------
    @property
    def state(self) -> TrackingState:
        """State after the last track call."""
        return self.pipeline.tracking.state

    @property
    def maps(self) -> list[MapSummary]:
        """The maps that hold keyframes, the oldest first."""
        slam_map = self.pipeline.back_end.map
        return [
            MapSummary(
                map_index=index,
                active=index == slam_map.active_map,
                n_keyframes=slam_map.n_keyframes_of(index),
                n_map_points=slam_map.n_points_of(index),
            )
            for index in slam_map.maps
        ]

    @property
    def n_keyframes(self) -> int:
        """Keyframes in all maps."""
        return int(self.pipeline.back_end.map.n_keyframes)

    @property
    def n_map_points(self) -> int:
        """Points in all maps."""
        return int(self.pipeline.back_end.map.n_points)

    @property
    def n_loops_closed(self) -> int:
        """Loops closed so far, over all maps."""
        return len(self.pipeline.back_end.loop_closing.loops)

    @property
    def loops(self) -> list[LoopClosed]:
        """The loops closed so far, over all maps."""
        return list(self.pipeline.back_end.loop_closing.loops)

    @property
    def merges(self) -> list[MapsMerged]:
        """The maps that have been merged into older ones so far."""
        return list(self.pipeline.back_end.loop_closing.merges)

    @property
    def full_adjustments(self) -> list[FullAdjustmentRecord]:
        """The full bundle adjustments so far, also those that were stopped."""
        return list(self.pipeline.back_end.adjustment.records)

    @property
    def n_resets(self) -> int:
        """Number of maps that were dropped for a new one, without failed starts."""
        return self.pipeline.n_resets

    @property
    def n_relocalizations(self) -> int:
        """Number of relocalizations after a loss."""
        return self.pipeline.tracking.n_relocalizations

    def trajectory(self) -> Trajectory:
        """Poses of all images of the active map, after the latest optimisation.

        `shutdown` estimates the poses of the last thousand images again, from their points in the
        final map.

        Returns
        -------
        Trajectory
            Time stamps, ``T_wc`` (n, 4, 4) relative to the map's first keyframe, and which frames
            were lost.
        """
        return self.pipeline.recorder.trajectory()

    def trajectories(self) -> list[Trajectory]:
        """One trajectory for each map, by its number: also of dropped maps and failed starts.

        Each is relative to the first keyframe of its map. The trajectory of a merged map is empty.
        """
        return self.pipeline.recorder.trajectories()

    def keyframe_trajectory(self, map_index: int | None = None) -> Trajectory:
        """Poses of the keyframes of a map (None: the active one), relative to the first one.

        Raises
        ------
        IndexError
            If no map of that number has begun. A merged or dropped map is empty.
        """
        self._check_map_index(map_index)
        return keyframe_trajectory(self.pipeline.back_end.map, map_index)

    def map_snapshot(self, map_index: int | None = None) -> MapSnapshot:
        """A copy of keyframe poses and points of a map (None: the active one), at any time.

        Raises
        ------
        IndexError
            If no map of that number has begun. A merged or dropped map is empty.
        """
        self._check_map_index(map_index)
        return take_snapshot(self.pipeline.back_end.map, map_index)

    def _check_map_index(self, map_index: int | None) -> None:
        """Refuse the number of a map that never began, because it would look like an empty one."""
        if map_index is None:
            return
        remedy = "give a number of those in System.maps, or None for the active map"
        if not is_whole(map_index):
            raise StateError(f"the number of the map is {shown(map_index)}; {remedy}")
        if map_index in self.pipeline.back_end.map.maps:
            return
        n_begun = len(self.trajectories())
        if not 0 <= map_index < n_begun:
            begun = f"{n_begun} {'has' if n_begun == 1 else 'have'} begun so far"
            raise IndexError(f"there is no map {map_index}; {begun}; {remedy}")

    def map_snapshots(self) -> list[MapSnapshot]:
        """Copies of all maps, the oldest first; `MapSnapshot.map_index` gives the number."""
        return take_snapshots(self.pipeline.back_end.map)

    def map_hash(self) -> int:
        """Hash over poses, points and observations: equal for equal maps."""
        return int(self.pipeline.back_end.map.content_hash())

    def check_map(self) -> list[str]:
        """Violated invariants of the maps, one sentence each; empty if the maps are consistent."""
        return list(core.check_invariants(self.pipeline.back_end.map, require_words=True))

    def stage_statistics(self) -> dict[str, dict[str, float]]:
        """Median, mean and p99 milliseconds per stage of tracking, mapping and loop closing."""
        return {**self.pipeline.statistics.summary(), **self.pipeline.back_end.statistics()}

    # ---- a block that shuts down at its end --------------------------------------------------
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
        except Exception as another:
            if error is None:
                raise
            the_same = isinstance(error, WorkerError) and isinstance(another, WorkerError)
            if not the_same:
                _log.exception("shutdown after an error failed as well")
