# SPDX-License-Identifier: BSD-3-Clause
"""The results of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.datasets.base import Source
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.maps.snapshot import MapSnapshot
from orbslam2py.runs.kept_images import KeptImages
from orbslam2py.runs.options import RunOptions
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.events import LoopClosed, MapsMerged
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord
from orbslam2py.slam.records import MapSummary, TrackingRecord, TrackingState
from orbslam2py.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class FrameRow:
    """One input frame and its result."""

    index: int
    """Index in the sequence."""
    timestamp: str
    """The source's text."""
    record: TrackingRecord | None
    """None for a skipped or dropped frame."""
    reason: str
    """Why there is no pose; empty if there is one."""
    latency: dict[str, float] | None = None
    """Milliseconds by the stages of `runs.latency.LATENCY_STAGES`; None for a recording."""

    @property
    def state(self) -> str:
        """Name of the tracking state, or SKIPPED or DROPPED."""
        if self.record is None:
            return "DROPPED" if self.reason == DROPPED else "SKIPPED"
        return self.record.state.name


#: Reason of a frame that real time left no room for.
DROPPED = "dropped to keep up with real time"


def empty_trajectory() -> Trajectory:
    """No poses."""
    return Trajectory(timestamps=np.zeros(0), T_wc=np.zeros((0, 4, 4)))


def empty_snapshot() -> MapSnapshot:
    """A map without anything."""
    ids = np.zeros(0, np.int64)
    edges = np.zeros((0, 2), np.int64)
    return MapSnapshot(ids, np.zeros(0), np.zeros((0, 4, 4)), ids, np.zeros((0, 3)), edges)


@dataclass
class RunResult:
    """All results of a run, complete or interrupted."""

    sequence: Source
    settings: Settings
    options: RunOptions
    n_frames: int | None
    """Number of frames to process; None for a camera during the run, then the number that was
    processed."""
    rows: list[FrameRow] = field(default_factory=list)
    trajectories: list[Trajectory] = field(default_factory=list)
    """One trajectory for each map, by its number, with lost frames; `Trajectory.indices` are
    positions in `rows`. Empty for a merged map."""
    main_map: int = 0
    """The map of the figures: of the maps at the end, the one with most tracked frames; if the
    system keeps only one, the last one."""
    maps: list[MapSummary] = field(default_factory=list)
    """The maps at the end, the oldest first."""
    keyframes: Trajectory = field(default_factory=empty_trajectory)
    """Keyframes of the main map."""
    snapshot: MapSnapshot = field(default_factory=empty_snapshot)
    """The main map."""
    other_maps: list[MapSnapshot] = field(default_factory=list)
    """Keyframes of the other maps at the end, each in its own world."""
    sightings: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    """(o, 2) ids of a point of the main map and of a keyframe that observes it."""
    drawing: MapArrays | None = None
    """The drawn parts of the main map."""
    kept_images: KeptImages | None = None
    """Images of some frames of a camera, which cannot be read again; None for a recording."""
    stages: dict[str, dict[str, float]] = field(default_factory=dict)
    seconds: float = 0.0
    slam_seconds: float = 0.0
    """Time in track calls and waiting for mapping."""
    n_resets: int = 0
    n_relocalizations: int = 0
    loops: list[LoopClosed] = field(default_factory=list)
    """Loops closed, over all maps."""
    merges: list[MapsMerged] = field(default_factory=list)
    """Merges of maps into older ones."""
    full_adjustments: list[FullAdjustmentRecord] = field(default_factory=list)
    """Full bundle adjustments, also those that were stopped."""
    final_adjustment: FullAdjustmentRecord | None = None
    """The last full bundle adjustment of the finished map, if it was requested."""
    median_depth: float | None = None
    """Of the first depth images [m]; None without depth."""
    alignment: dict[str, Any] | None = None
    """Noise of aligned sightings, as in ``report.json``; None where nothing is aligned."""
    imu: dict[str, Any] | None = None
    """Results about the IMU, as in ``report.json``; None without one."""
    imu_settings: ImuSettings | None = None
    """Noise, place and clock of the IMU that the run used; None without one."""
    warnings: list[str] = field(default_factory=list)
    """Warnings about the result: a calibration that does not fit, a loss until the end."""
    calibration_warnings: list[str] = field(default_factory=list)
    """Warnings about the settings: of the lens, or of the depth images."""
    n_lost_by_camera: int = 0
    """Images of a camera that came while an earlier one was being tracked."""
    input_counts: dict[str, float] | None = None
    """Counts of a live source: frames, losses, samples; None if it counts nothing."""
    is_live: bool = False
    """The images came from a camera."""
    saved_map: Path | None = None
    """The file of the saved maps; None if there is none, or if it has an older state."""
    last_save_failed: bool = False
    """Whether the maps were not saved as requested, or not in their last state."""
    interrupted: bool = False
    """Whether the run was stopped before its end; never for a camera, which has none."""
    error: Exception | None = None
    """Why it ended early."""
    started: str = ""
    """Date and time of its beginning, ISO 8601 with the time zone."""
    command: str | None = None
    """The command line that repeats it, if there is one."""

    @property
    def n_tracked(self) -> int:
        """Frames with a pose."""
        return sum(r.record is not None and r.record.state is TrackingState.OK for r in self.rows)

    @property
    def n_skipped(self) -> int:
        """Number of frames that were unreadable or refused."""
        return sum(row.state == "SKIPPED" for row in self.rows)

    @property
    def n_dropped(self) -> int:
        """Number of frames that were dropped in real time."""
        return self.n_lost_by_camera + sum(row.state == "DROPPED" for row in self.rows)

    @property
    def is_metric(self) -> bool:
        """Whether lengths of the main map are metres: with depth, or where an IMU scaled it."""
        return self.options.sensor.has_depth or bool((self.imu or {}).get("metric"))

    def tracked_trajectory(self) -> Trajectory:
        """Number of frames of the main map with a pose, after the last optimisation."""
        if not self.trajectories:
            return empty_trajectory()
        main = self.trajectories[self.main_map]
        return main.select(~main.lost)

    def online_trajectory(self) -> Trajectory:
        """Poses from the time of tracking.

        Poses of frames that were tracked in the main map; if the system keeps only one map, of all
        consecutive maps, each in its own world frame.
        """
        several = self.options.system.several_maps
        tracked = [
            (position, row.record)
            for position, row in enumerate(self.rows)
            if row.record is not None
            and row.record.T_cw is not None
            and (not several or row.record.map_index == self.main_map)
        ]
        if not tracked:
            return empty_trajectory()
        return Trajectory(
            timestamps=np.array([record.timestamp for _, record in tracked]),
            T_wc=np.array([record.T_wc for _, record in tracked]),
            indices=np.array([position for position, _ in tracked]),
        )
