# SPDX-License-Identifier: BSD-3-Clause
"""What a run is asked for, and what it gives."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from orbslam2py.datasets.base import Source
from orbslam2py.errors import DatasetError
from orbslam2py.maps.snapshot import MapSnapshot
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.events import LoopClosed
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord, check_time_limit
from orbslam2py.slam.records import TrackingRecord, TrackingState
from orbslam2py.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class RunOptions:
    """What to run and how.

    Raises
    ------
    SettingsError
        If the time limit is not more than 0, or given for a deterministic run.
    """

    sensor: Sensor
    deterministic: bool = False
    realtime: bool = False
    """Follow the time stamps and drop frames as a camera would; otherwise every frame is tracked,
    as fast as possible, waiting for mapping."""
    start: int = 0
    """Index of the first frame."""
    stride: int = 1
    """Take every so many frames."""
    max_frames: int | None = None
    """Take at most so many frames."""
    seed: int = 0
    localize_after: int | None = None
    """Switch to localization mode after so many frames."""
    loop_closing: bool = True
    """Recognise places seen before and take out the drift."""
    full_adjustment: bool = True
    """After a loop, refine the whole map."""
    full_adjustment_time_limit: float | None = None
    """Seconds after which that ends with what it has reached."""

    def __post_init__(self) -> None:
        check_time_limit(self.full_adjustment_time_limit, deterministic=self.deterministic)

    def indices(self, n_frames: int) -> list[int]:
        """Indices of the frames of a sequence that are used.

        Raises
        ------
        DatasetError
            If there are none, or the options contradict each other.
        """
        if self.deterministic and self.realtime:
            raise DatasetError(
                "--deterministic and --realtime exclude each other: dropping frames depends on time"
            )
        if (
            self.start < 0
            or self.stride < 1
            or (self.max_frames is not None and self.max_frames < 1)
        ):
            raise DatasetError("--start must be 0 or more, --stride and --max-frames 1 or more")
        indices = list(range(self.start, n_frames, self.stride))
        if not indices:
            raise DatasetError(f"--start {self.start} is past the end: {n_frames} frames")
        return indices[: self.max_frames]

    def check_for_camera(self) -> None:
        """See that the options make sense for a camera.

        Raises
        ------
        DatasetError
            Naming the option that does not.
        """
        if self.deterministic or self.realtime:
            name = "--deterministic" if self.deterministic else "--realtime"
            raise DatasetError(f"{name} is for recorded images: a camera always goes in real time")
        if self.start != 0 or self.stride != 1:
            name = "--start" if self.start != 0 else "--stride"
            raise DatasetError(f"{name} is for recorded images, not for a camera")
        if self.max_frames is not None and self.max_frames < 1:
            raise DatasetError("--max-frames must be 1 or more")


@dataclass(frozen=True)
class FrameRow:
    """One input frame and what became of it."""

    index: int
    """Index in the sequence."""
    timestamp: str
    """The source's text."""
    record: TrackingRecord | None
    """None for a skipped or dropped frame."""
    reason: str
    """Why there is no pose; empty if there is one."""

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
    """Everything a run gives, whether it ended or was interrupted."""

    sequence: Source
    settings: Settings
    options: RunOptions
    n_frames: int | None
    """Frames that were to be processed; None for a camera as long as it runs, then those that
    were."""
    rows: list[FrameRow] = field(default_factory=list)
    trajectories: list[Trajectory] = field(default_factory=list)
    """One per map, lost frames included; `Trajectory.indices` are positions in `rows`."""
    keyframes: Trajectory = field(default_factory=empty_trajectory)
    """Keyframes of the last map."""
    snapshot: MapSnapshot = field(default_factory=empty_snapshot)
    """The last map."""
    stages: dict[str, dict[str, float]] = field(default_factory=dict)
    seconds: float = 0.0
    slam_seconds: float = 0.0
    """Time in track calls and waiting for mapping."""
    n_resets: int = 0
    n_relocalizations: int = 0
    loops: list[LoopClosed] = field(default_factory=list)
    """Loops closed, over all maps."""
    full_adjustments: list[FullAdjustmentRecord] = field(default_factory=list)
    """Full bundle adjustments, also those that were given up."""
    n_lost_by_camera: int = 0
    """Images of a camera that came while an earlier one was being tracked."""
    is_live: bool = False
    """The images came from a camera."""
    interrupted: bool = False
    """The run was stopped before its end; never for a camera, which has none."""
    error: Exception | None = None
    """What ended it."""

    @property
    def n_tracked(self) -> int:
        """Frames with a pose."""
        return sum(r.record is not None and r.record.state is TrackingState.OK for r in self.rows)

    @property
    def n_skipped(self) -> int:
        """Frames that could not be read or were refused."""
        return sum(row.state == "SKIPPED" for row in self.rows)

    @property
    def n_dropped(self) -> int:
        """Frames that real time left no room for."""
        return self.n_lost_by_camera + sum(row.state == "DROPPED" for row in self.rows)

    def tracked_trajectory(self) -> Trajectory:
        """Frames of the last map that have a pose, after the last optimisation."""
        if not self.trajectories:
            return empty_trajectory()
        last = self.trajectories[-1]
        return last.select(~last.lost)

    def online_trajectory(self) -> Trajectory:
        """Poses as they were when each frame was tracked; every map in its own world frame."""
        tracked = [
            (position, row.record)
            for position, row in enumerate(self.rows)
            if row.record is not None and row.record.T_cw is not None
        ]
        if not tracked:
            return empty_trajectory()
        return Trajectory(
            timestamps=np.array([record.timestamp for _, record in tracked]),
            T_wc=np.array([record.T_wc for _, record in tracked]),
            indices=np.array([position for position, _ in tracked]),
        )

    def why_nothing_was_tracked(self) -> str:
        """The most frequent reason."""
        reasons = Counter(row.reason for row in self.rows if row.reason)
        return reasons.most_common(1)[0][0] if reasons else "no frames"
