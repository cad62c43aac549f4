# SPDX-License-Identifier: BSD-3-Clause
"""A video of a run: the image with its keypoints, the map from above, a time line."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arguments import instance_of, is_whole, number_above_zero, shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.errors import OutputFileError
from orbslam2py.maps import MapChanges
from orbslam2py.pictures.composition import Composition, compose
from orbslam2py.pictures.framing import Framing, frame_all
from orbslam2py.pictures.overlay import Marks, Status, draw_overlay, draw_status
from orbslam2py.pictures.time_line import GrowingHistory, draw_time_line
from orbslam2py.pictures.top_view import bounds, draw_ground, draw_top_view
from orbslam2py.recordings.growing_map import GrowingMap
from orbslam2py.recordings.video_file import VideoFile
from orbslam2py.slam.events import Event, LoopClosed
from orbslam2py.slam.records import TrackingState
from orbslam2py.trajectory import Trajectory
from orbslam2py.viewer.paths import TruthBeside
from orbslam2py.viewer.watching import FrameView

#: More than the codecs take.
_LARGEST_SIDE = 16384
#: A pause of a stream of images is shown by at most this number of pictures.
_LONGEST_PAUSE = 300
#: Images over which the rate of a recording is measured.
_RATE_IMAGES = 30
#: Keyframes, edges and tens of points that are drawn anew for each image.
_DRAWN_AT_ONCE = 4000


class VideoWriter:
    """Writes images and results of a system into a video file, without a screen.

    >>> with orb.System("tum1", "rgbd") as slam:  # doctest: +SKIP
    ...     video = orb.VideoWriter("desk.mp4")
    ...     with orb.Publisher(slam, [video], every_frame=True):
    ...         slam.run(sequence)

    Parameters
    ----------
    path : str or Path
        Ends with ``.mp4``, ``.mov``, ``.mkv``, ``.avi`` or ``.webm``. The file appears when it is
        complete; it replaces an existing one.
    frames_per_second : float
        Frames per second of the video: the rate of the recording.
    duration : float, optional
        Length of the whole recording in seconds, for the time line; without it, the time line
        grows.
    in_time : bool
        Whether images may be missing, as in real time: then a picture stays until the next one.
        Otherwise there is one picture for each image.
    unit : str
        Unit of length: "m", or "units" with a single camera, whose map has its own.
    ground_truth : Trajectory, optional
        Ground truth, drawn beside the trajectory up to the present time.
    size : (int, int)
        Width and height of the video [px], both even and at least 320 and 240.

    Raises
    ------
    OutputFileError
        If the video certainly cannot be written, or if a size, a rate, a duration or a ground truth
        is invalid.
    """

    name = "the video"

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        frames_per_second: float = 30.0,
        duration: float | None = None,
        in_time: bool = False,
        unit: str = "m",
        ground_truth: Trajectory | None = None,
        size: tuple[int, int] = (1280, 720),
    ) -> None:
        size = _checked_size(size)
        rate = number_above_zero(
            frames_per_second, "frames_per_second", "images a second, above 0", OutputFileError
        )
        # A recording of one image lasts for no time.
        if duration is not None and duration != 0:
            remedy = "seconds, 0 or more, or None"
            duration = number_above_zero(duration, "duration", remedy, OutputFileError)
        if ground_truth is not None:
            remedy = "an orbslam2py.Trajectory, or None"
            instance_of(ground_truth, Trajectory, "ground_truth", remedy, OutputFileError)
        self._frames_per_second = float(np.clip(rate, 1.0, 240.0))
        self._file = VideoFile(path, size, self._frames_per_second)
        self._in_time = in_time
        self._unit = unit
        self._truth = (
            None if ground_truth is None else TruthBeside(ground_truth, with_scale=unit != "m")
        )
        self._times: deque[float] = deque(maxlen=_RATE_IMAGES)
        self._size = size
        self._map = GrowingMap()
        self._history = GrowingHistory(duration)
        self._composition: Composition | None = None
        self._framing: Framing | None = None
        self._picture: ByteArray | None = None
        self._ground: ByteArray | None = None
        self._ground_cost = self._age = 0
        self._status = Status(TrackingState.NO_IMAGES_YET)
        self._shown = np.zeros((1, 1, 3), np.uint8)
        self._local_points: IntArray | None = None
        self._last_pose: tuple[int, FloatArray] | None = None
        self._begin: float | None = None
        self._now: float | None = None
        self._unused: list[_Unused] = []
        self._n_seen = 0
        self._lock = threading.Lock()

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self._file.path

    @property
    def n_frames(self) -> int:
        """Number of pictures in the video so far."""
        return self._file.n_frames

    def add_unused(self, position: int, timestamp: float, reason: str) -> None:
        """Show that an image could not be used: repeat the picture before it.

        May be called from any thread, before the next image is tracked.

        Parameters
        ----------
        position : int
            Number of images that were tracked before.
        timestamp : float
            Its time [s].
        reason : str
            Why.
        """
        with self._lock:
            self._unused.append(_Unused(position, timestamp, reason))

    # ---- notifications ---------------------------------------------------------------------------
    def on_map(self, changes: MapChanges) -> None:
        """Apply the changes."""
        self._map.apply(changes)

    def on_event(self, event: Event) -> None:
        """Mark loops."""
        if isinstance(event, LoopClosed):
            self._history.add_loop(event.current_timestamp)

    def on_frame(self, view: FrameView) -> None:
        """Draw an image."""
        for record in view.earlier:
            self._history.add(record, wanders=record.visual_odometry)
            self._map.add_frame(record)
        self._n_seen += len(view.earlier)
        if self._composition is None:
            shape = view.image.shape
            self._composition = compose((shape[1], shape[0]), self._size)
            self._shown = np.zeros((*self._composition.image.size[::-1], 3), np.uint8)
        self._show_unused()
        self._take(view, self._composition)
        self._n_seen += 1
        if self._in_time:
            self._catch_up(view.record.timestamp)
        self._write(self._composition)

    def close(self) -> None:
        """Finish the file and give it its name."""
        try:
            self._show_unused()
        finally:
            self._file.close()

    # ---- pictures --------------------------------------------------------------------------------
    def _take(self, view: FrameView, composition: Composition) -> None:
        record = view.record
        self._now = record.timestamp
        n_wandering = int(np.count_nonzero(view.visual_odometry))
        n_matched = int(np.count_nonzero(view.matched))
        self._history.add(record, wanders=n_wandering > n_matched)
        self._map.add_frame(record)
        self._local_points = view.local_points
        if record.T_wc is not None:
            self._last_pose = (record.map_index, record.T_wc)
        self._status = Status(
            state=record.state,
            reason=str(record.reason),
            localization=view.localization,
            n_keyframes=self._map.n_keyframes,
            n_points=self._map.n_points,
            n_matches=n_matched,
            n_visual_odometry=n_wandering,
            frames_per_second=self._rate(view),
            n_dropped=view.queue.n_dropped if self._in_time else None,
        )
        self._shown = draw_overlay(view.image, _marks(view), size=composition.image.size)

    def _rate(self, view: FrameView) -> float | None:
        """Images per second: tracked ones, or those of the recording if it waits for the video."""
        if self._in_time:
            return view.queue.frames_per_second or None
        self._times.append(view.record.timestamp)
        seconds = self._times[-1] - self._times[0]
        return (len(self._times) - 1) / seconds if seconds > 0 else None

    def _show_unused(self) -> None:
        """Show the unusable images up to the present one."""
        if self._composition is None:
            return
        with self._lock:
            due = [each for each in self._unused if each.position <= self._n_seen]
            self._unused = [each for each in self._unused if each.position > self._n_seen]
        for each in due:
            self._history.add_unused(each.timestamp)
            if not self._in_time:
                self._status = replace(
                    self._status, skipped=True, reason=each.reason, n_matches=0, n_visual_odometry=0
                )
                self._write(self._composition)

    def _write(self, composition: Composition) -> None:
        picture = self._picture
        if picture is None:
            picture = self._picture = composition.ground()
        composition.image.put(picture, self._shown)
        composition.status.put(picture, draw_status(composition.status.width, self._status))
        composition.map.put(picture, self._draw_map(composition))
        line = draw_time_line(
            self._history.picture(), composition.time_line.size, text=composition.text
        )
        composition.time_line.put(picture, line)
        self._file.write(picture)

    def _draw_map(self, composition: Composition) -> ByteArray:
        # A large map takes long to draw, and one image more changes little of it.
        due = self._ground is None or self._age > self._ground_cost // _DRAWN_AT_ONCE
        scene = self._map.picture(self._local_points, renew=due)
        if self._truth is not None and self._now is not None:
            truth = self._truth.until(self._now, self._map.map_index, self._map.path)
            scene = replace(scene, truth=truth)
        low, high = bounds(scene)
        framing = frame_all(low, high, composition.map.size)
        if self._framing is not None:
            framing = self._framing.follow(low, high, 1.0 / self._frames_per_second)
        if due or self._framing is None or (framing.state != self._framing.state).any():
            self._ground = draw_ground(scene, framing, text=composition.text)
            self._ground_cost = len(scene.keyframes) + len(scene.covisibility)
            self._ground_cost += len(scene.points) // 10
        self._age = 0 if due else self._age + 1
        if len(scene.keyframes):  # a first look that shows nothing has no say in the next
            self._framing = framing
        pose = self._last_pose
        return draw_top_view(
            scene,
            framing,
            T_wc=pose[1] if pose is not None and pose[0] == self._map.map_index else None,
            lost=self._status.state is not TrackingState.OK,
            unit=self._unit,
            text=composition.text,
            ground=self._ground,
        )

    def _catch_up(self, timestamp: float) -> None:
        """Repeat the last picture for the time until an image."""
        if self._picture is None or self._begin is None:
            self._begin = timestamp
            return
        due = round((timestamp - self._begin) * self._frames_per_second)
        missing = due - self._file.n_frames
        for _ in range(min(missing, _LONGEST_PAUSE)):
            self._file.write(self._picture)
        if missing > _LONGEST_PAUSE:
            self._begin += (missing - _LONGEST_PAUSE) / self._frames_per_second


@dataclass(frozen=True)
class _Unused:
    """An image that was not tracked."""

    position: int
    timestamp: float
    reason: str


def _checked_size(size: Any) -> tuple[int, int]:
    sides = tuple(size) if isinstance(size, Sequence | np.ndarray) else ()
    if len(sides) != 2 or not all(is_whole(side) and side <= _LARGEST_SIDE for side in sides):
        raise OutputFileError(
            f"size is {shown(size)}; give width and height in pixels, up to {_LARGEST_SIDE}"
        )
    width, height = map(int, sides)
    if width < 320 or height < 240 or width % 2 or height % 2:
        raise OutputFileError(
            f"a video cannot be {width} x {height} pixels large; take even numbers from "
            "320 x 240 on"
        )
    return width, height


def _marks(view: FrameView) -> Marks:
    pixels, matched = view.pixels, view.matched
    return Marks(
        mapped=pixels[matched],
        visual_odometry=pixels[view.visual_odometry],
        unmatched=pixels[~matched & ~view.visual_odometry],
        start_lines=np.zeros((0, 4)) if view.start_lines is None else view.start_lines,
    )
