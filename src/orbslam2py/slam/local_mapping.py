# SPDX-License-Identifier: BSD-3-Clause
"""Local mapping: the work on the map for every new keyframe.

Mur-Artal, Montiel and Tardos, 2015, section VI; ``docs/method/mapping.md``.
"""

from __future__ import annotations

from collections.abc import Callable

from orbslam2py import _core as core
from orbslam2py._timing import StageStatistics, StageTimer
from orbslam2py._worker import Worker
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import AlignmentConfig, MappingConfig


class LocalMapping:
    """Integrates keyframes: points, fusion, bundle adjustment, culling.

    If a keyframe waits, fusion, bundle adjustment and culling of the present one are skipped.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    sensor : Sensor
        Sets the requirements for new points.
    keyframe_index : orbslam2py._core.KeyFrameIndex
        Removes culled keyframes.
    threaded : bool
        Whether to use a separate thread; otherwise `start` works inline.
    adjustment_threads : int
        Number of threads for local bundle adjustment, 1 or 2; the result is the same.
    config : MappingConfig
        Limits.
    alignment : AlignmentConfig or None
        Settings of the alignment; None: nothing.
    """

    def __init__(
        self,
        slam_map: core.Map,
        sensor: Sensor,
        keyframe_index: core.KeyFrameIndex,
        config: MappingConfig,
        *,
        threaded: bool,
        adjustment_threads: int = 1,
        alignment: AlignmentConfig | None = None,
    ) -> None:
        limits = config
        self._map = slam_map
        self._keyframe_index = keyframe_index
        self._monocular = sensor is Sensor.MONOCULAR
        #: ``on_done(keyframe_id)``: takes the finished keyframe (loop closing).
        self.on_done: Callable[[int], None] = lambda keyframe: None
        self._inserted: list[int] = []
        self._recent_points = core.RecentPoints()
        self._point_options = core.NewPointOptions()
        self._point_options.monocular = self._monocular
        self._n_neighbours = limits.neighbours_monocular if self._monocular else limits.neighbours
        self._point_options.n_neighbours = self._n_neighbours
        self._min_observations = (
            limits.observations_monocular if self._monocular else limits.observations
        )
        self._adjustment_threads = adjustment_threads
        self._adjusted_keyframes = limits.adjusted_keyframes
        #: Velocities and biases at keyframes, once an IMU has started.
        self.inertial: core.InertialKeyframes | None = None
        self._alignment = alignment
        #: Milliseconds per part of the work, over all keyframes.
        self.statistics = StageStatistics()
        self.worker: Worker[int] = Worker("local mapping", self.process, threaded=threaded)

    def insert_keyframe(self, keyframe: int) -> None:
        """Store a keyframe; `start` begins its mapping."""
        self._inserted.append(keyframe)

    def start(self) -> None:
        """Queue the stored keyframes; a running bundle adjustment is asked to end early.

        Call it after the frame is recorded: otherwise mapping may move the keyframe before the
        relative pose of the frame is stored.
        """
        inserted, self._inserted = self._inserted, []
        self.worker.submit(*inserted)

    def reset(self) -> None:
        """Drop waiting keyframes and the points under probation."""
        self.worker.reset()
        self._inserted.clear()
        self._recent_points.clear()

    def process(self, keyframe: int) -> None:
        """Do all work for one keyframe."""
        timer = StageTimer()
        with timer("mapping"):
            with timer("mapping.insert"):
                core.process_new_keyframe(self._map, keyframe, self._recent_points)
            with timer("mapping.cull_points"):
                core.cull_recent_points(
                    self._map, keyframe, self._min_observations, self._recent_points
                )
            with timer("mapping.new_points"):
                new_points = core.create_new_points(
                    self._map, keyframe, self._point_options, self.worker.waiting_flag
                )
                self._recent_points.extend(new_points)
            if not self.worker.n_waiting:
                with timer("mapping.fuse"):
                    core.fuse_with_neighbours(self._map, keyframe, self._n_neighbours)
            self._align(keyframe, timer)
            if self.worker.lower_interrupt():
                self._refine(keyframe, timer)
        self.statistics.add(timer.milliseconds)
        self.on_done(keyframe)

    def _align(self, keyframe: int, timer: StageTimer) -> None:
        alignment = self._alignment
        if alignment is None or not alignment.uses_points:
            return
        with timer("mapping.align"):
            core.align_keyframes(
                self._map,
                keyframe,
                patches_only=not alignment.new_keyframes,
                n_threads=self._adjustment_threads,
            )

    def _refine(self, keyframe: int, timer: StageTimer) -> None:
        n_keyframes = self._map.n_keyframes_of(self._map.map_of(keyframe))
        if n_keyframes > self._adjusted_keyframes:
            with timer("mapping.local_bundle_adjustment"):
                core.local_bundle_adjustment(
                    self._map,
                    keyframe,
                    self.worker.interrupt_flag,
                    self._monocular,
                    self._adjustment_threads,
                    inertial=self.inertial,
                    measures_noise=self._alignment is not None,
                )
        with timer("mapping.cull_keyframes"):
            culled = core.cull_keyframes(
                self._map, keyframe, not self._monocular, inertial=self.inertial
            )
            for dead in culled.tolist():
                self._keyframe_index.erase(dead)
