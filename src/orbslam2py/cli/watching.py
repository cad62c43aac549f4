# SPDX-License-Identifier: BSD-3-Clause
"""Files that record a run: a video, a recording."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from orbslam2py._arrays import FloatArray
from orbslam2py.cli.publishing import MCAP
from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.errors import OrbSlamError, OutputFileError
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.result import FrameRow
from orbslam2py.runs.runner import Watch
from orbslam2py.slam.system import System
from orbslam2py.trajectory import Trajectory

if TYPE_CHECKING:
    from orbslam2py.recordings.video import VideoWriter
    from orbslam2py.viewer import Watcher

VideoOption = Annotated[
    Path | None,
    typer.Option(
        help="Write a video: image and keypoints, map from above, time line (.mp4, .mov, .mkv, "
        ".avi; .webm for browsers).",
        metavar="FILE.mp4",
    ),
]
RecordOption = Annotated[
    Path | None,
    typer.Option(
        help="Record images, map, plots and events for Rerun's viewer (.rrd, needs "
        "orbslam2py[rerun]), or poses, map and images for Foxglove and ROS 2 (.mcap, needs "
        "orbslam2py[foxglove]).",
        metavar="FILE.rrd",
    ),
]
#: Ending of recordings for Rerun.
_RRD = ".rrd"
#: How fast a camera's video is played: what its images are repeated or left out for [1/s].
_LIVE_RATE = 30.0
#: Looks at the map a second, in real time.
_LIVE_MAP_RATE = 10.0


@dataclass
class FileWatchers:
    """Watchers that write files, as a part of a run.

    Parameters
    ----------
    in_time : bool
        Whether the run is in real time: then images that come too fast are left out.
    """

    in_time: bool
    watchers: list[Watcher] = field(default_factory=list)
    files: dict[str, Path] = field(default_factory=dict)
    video: VideoWriter | None = None
    _n_tracked: int = 0
    _seconds: FloatArray | None = None

    def add_video(self, path: Path, source: Sequence | LiveSource, options: RunOptions) -> None:
        """Write a video."""
        from orbslam2py.recordings.video import VideoWriter  # noqa: PLC0415

        times = _times(source, options)
        self._seconds = np.asarray(source.timestamps) if is_sequence(source) else None
        duration, rate = None, _LIVE_RATE
        if times is not None:
            duration = float(times[-1] - times[0])
            rate = 1.0 / float(np.median(np.diff(times))) if duration > 0 else rate
        self.video = VideoWriter(
            path,
            frames_per_second=rate,
            duration=duration,
            in_time=self.in_time,
            unit="m" if options.sensor.has_depth else "units",
            ground_truth=_truth(source),
        )
        self.watchers.append(self.video)
        self.files["video"] = path

    def add_recording(self, path: Path, source: Sequence | LiveSource, options: RunOptions) -> None:
        """Write a recording for Rerun; those for Foxglove are published, see `publishing`."""
        if path.suffix.lower() == MCAP:
            self.files["recording"] = path
            return
        if path.suffix.lower() != _RRD:
            raise OutputFileError(
                f"{path} does not end like a recording; name it with {_RRD} or {MCAP}"
            )
        from orbslam2py.recordings.rerun_recorder import RerunRecorder  # noqa: PLC0415

        recorder = RerunRecorder(
            path,
            settings=source.settings,
            ground_truth=_truth(source),
            with_scale=not options.sensor.has_depth,
        )
        self.watchers.append(recorder)
        self.files["recording"] = path

    def __enter__(self) -> FileWatchers:
        return self

    def __exit__(self, *error: object) -> None:
        """Close files that the run has not closed, because it did not begin."""
        for watcher in self.watchers:
            watcher.close()

    @contextlib.contextmanager
    def watch(self, system: System) -> Iterator[None]:
        """Watch a system from its first image to its last."""
        if not self.watchers:
            yield
            return
        from orbslam2py.viewer import Publisher  # noqa: PLC0415

        with Publisher(
            system,
            self.watchers,
            frame_rate=_LIVE_RATE,
            map_rate=_LIVE_MAP_RATE,
            every_frame=not self.in_time,
        ):
            yield

    def tell(self, console: Console) -> None:
        """Print where the files are."""
        for what, path in self.files.items():
            if path.is_file():
                where = escape(str(path))
                console.print(f"The {what} is [bold]{where}[/]", highlight=False, soft_wrap=True)

    def count(self, row: FrameRow) -> None:
        """Report images that were not tracked."""
        if row.record is not None:
            self._n_tracked += 1
        elif self.video is not None and self._seconds is not None:
            seconds = float(self._seconds[row.index])  # the row's text may count nanoseconds
            self.video.add_unused(self._n_tracked, seconds, row.reason)


def file_watchers(
    source: Sequence | LiveSource,
    options: RunOptions,
    video: Path | None,
    record: Path | None,
) -> FileWatchers:
    """Create the writers of the requested files, and check that the files can be written.

    Raises
    ------
    OrbSlamError
        The message names the file that cannot be written, or the package to install.
    """
    in_time = options.realtime or not is_sequence(source)
    with contextlib.ExitStack() as stack:
        files = stack.enter_context(FileWatchers(in_time))
        if video is not None:
            files.add_video(video, source, options)
        if record is not None:
            files.add_recording(record, source, options)
        stack.pop_all()
    return files


def watch_all(*watches: Watch) -> Watch:
    """Let several watch the same system."""

    @contextlib.contextmanager
    def watch(system: System) -> Iterator[None]:
        with contextlib.ExitStack() as stack:
            for each in watches:
                stack.enter_context(each(system))
            yield

    return watch


def _truth(source: Sequence | LiveSource) -> Trajectory | None:
    try:
        return source.ground_truth()
    except (OrbSlamError, OSError):
        return None  # the report says why


def _times(source: Sequence | LiveSource, options: RunOptions) -> FloatArray | None:
    """Return the time stamps of the used images of a recording."""
    if not is_sequence(source):
        return None
    return np.asarray(source.timestamps)[options.indices(len(source))]
