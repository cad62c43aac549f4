# SPDX-License-Identifier: BSD-3-Clause
"""Sends frames and map changes of a running system to watchers, in a separate thread.

>>> with orb.System("tum1", "rgbd") as slam, Publisher(slam, [viewer, video]):  # doctest: +SKIP
...     slam.run(sequence)
"""

from __future__ import annotations

import logging
import math
import sys
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from operator import methodcaller
from types import TracebackType

import cv2
import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import is_number, shown
from orbslam2py._arrays import ByteArray
from orbslam2py._files import describe_error
from orbslam2py.errors import StateError
from orbslam2py.maps.changes import MapChanges
from orbslam2py.slam.events import Event
from orbslam2py.slam.system import System
from orbslam2py.slam.watched_frame import WatchedFrame
from orbslam2py.viewer.level_map import LevelMapFollower, turned_record
from orbslam2py.viewer.resting_maps import RestingMapsFollower, RestingMapsWatcher
from orbslam2py.viewer.watching import FrameView, QueueState, Watcher

_log = logging.getLogger(__name__)

#: Views that wait for the watchers when every frame is wanted.
_WAITING_VIEWS = 4
#: Pause after a look at the map, as a multiple of its duration: loops move all of the map.
_REST = 4.0
#: Seconds between two looks at the maps that rest.
_RESTING_PERIOD = 1.0
#: Seconds after which a thread that computes in Python lets another in. Python's own are ten times
#: as many, for which tracking would wait again and again within one image.
_SWITCH_INTERVAL = 5e-4
#: Images over which the rate is measured.
_RATE_IMAGES = 30
_RATES = "how many there may be in a second, more than 0"


class Publisher:
    """Takes frames and changes of the map from a system, and gives them to watchers.

    The system is delayed only by the copy of the image and its keypoints: watchers work in the
    publisher's thread. Frames that come too fast for the watchers are skipped, except the last one
    and keyframes; the records of all are kept.

    Maps that an IMU has turned upright are given in a world with y down, as those without an IMU:
    keyframes, points, and the poses of records.

    Parameters
    ----------
    system : System
        Whom to watch.
    watchers : iterable of Watcher
        The watchers.
    frame_rate : float
        Most images per second.
    map_rate : float
        Largest number of queries of the map per second.
    every_frame : bool
        Skip no frame, and query the map with each: the track call waits until there is room for
        one. For a video of a recorded sequence.

    Raises
    ------
    StateError
        If `system` is no `System`, a watcher lacks an attribute of `Watcher`, or a rate is not
        above 0.
    """

    def __init__(
        self,
        system: System,
        watchers: Iterable[Watcher],
        *,
        frame_rate: float = 15.0,
        map_rate: float = 5.0,
        every_frame: bool = False,
    ) -> None:
        if not isinstance(system, System):
            raise StateError(f"a publisher watches a System, not {shown(system)}")
        for what, rate in (("frame_rate", frame_rate), ("map_rate", map_rate)):
            if not (is_number(rate) and rate > 0):
                raise StateError(f"{what} is {shown(rate)}; give {_RATES}")
        watchers = list(watchers)
        for watcher in watchers:
            if not isinstance(watcher, Watcher):
                raise StateError(
                    f"{shown(watcher)} is no watcher; it needs a name, on_frame, on_map, on_event "
                    "and close"
                )
        # The parts and not the system: one that is dropped is to end, whoever watches.
        self._pipeline = system.pipeline
        self._rgb = system.settings.camera.rgb
        self._watchers = watchers
        self._frame_period = 0.0 if every_frame else 1.0 / frame_rate
        self._map_period = 1.0 / map_rate
        self._every_frame = every_frame
        self._follower = LevelMapFollower(system.pipeline.back_end.map)
        self._resting = RestingMapsFollower(system.pipeline.back_end.map)
        self._condition = threading.Condition()
        #: With the changes of the map that were seen with the image, when none is passed over.
        self._views: deque[tuple[MapChanges | None, FrameView]] = deque()
        self._events: deque[Event] = deque()
        self._seen_at: deque[float] = deque(maxlen=_RATE_IMAGES)
        self._next_view_at = 0.0
        self._next_look_at = self._next_resting_at = 0.0
        self._n_frames = self._n_not_shown = self._n_dropped = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="viewer publisher", daemon=True)
        self._pipeline.frame_watchers += (self._see,)
        self._pipeline.back_end.events.watchers += (self._hear,)
        self._thread.start()
        # Who forgets to close it: no thread may be in C++ when the interpreter ends.
        self._finalizer = weakref.finalize(self, _end, self._thread, weakref.ref(self))

    def count_dropped(self) -> None:
        """Report an image that was dropped before tracking."""
        self._n_dropped += 1

    def close(self) -> None:
        """Send the remaining data to the watchers, and end; may be called again."""
        events = self._pipeline.back_end.events
        self._pipeline.frame_watchers = tuple(
            watch for watch in self._pipeline.frame_watchers if watch != self._see
        )
        events.watchers = tuple(watch for watch in events.watchers if watch != self._hear)
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()
            self._finalizer.detach()

    def __enter__(self) -> Publisher:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # ---- in the system's threads -----------------------------------------------------------------
    def _see(self, frame: WatchedFrame) -> None:
        self._n_frames += 1
        self._seen_at.append(time.perf_counter())
        view = self._view(frame)
        # Who passes over no image sees with each the map of its time, not of when it is drawn.
        changes = self._follower.update() if self._every_frame and self._works() else None
        with self._condition:
            if self._every_frame:
                self._condition.wait_for(
                    lambda: len(self._views) < _WAITING_VIEWS or not self._works()
                )
            else:
                view = self._make_room(view)
            if self._works():
                self._views.append((changes, view))
            self._condition.notify_all()

    def _make_room(self, view: FrameView) -> FrameView:
        """Skip the image before, unless it is a keyframe, of which some may wait."""
        if not self._views:
            return view
        if self._views[-1][1].record.is_keyframe and len(self._views) < _WAITING_VIEWS:
            return view
        _, late = self._views.pop()
        self._n_not_shown += 1
        queue = replace(view.queue, n_not_shown=self._n_not_shown)
        return replace(view, earlier=(*late.earlier, late.record, *view.earlier), queue=queue)

    def _view(self, frame: WatchedFrame) -> FrameView:
        features = frame.features()
        ids = features.map_point_ids
        temporary = (ids < 0) | (ids >= core.FIRST_TEMPORARY_POINT)
        return FrameView(
            image=_copied(frame.image, rgb=self._rgb),
            record=turned_record(frame.record, self._pipeline.back_end.map),
            earlier=(),
            features=features,
            pixels=frame.pixels(),
            visual_odometry=features.inliers & temporary,
            local_points=frame.local_points(),
            start_lines=frame.start_lines(),
            localization=self._pipeline.localization.on,
            queue=QueueState(
                n_frames=self._n_frames,
                n_not_shown=self._n_not_shown,
                n_dropped=self._n_dropped,
                frames_per_second=_rate(self._seen_at),
            ),
        )

    def _hear(self, event: Event) -> None:
        with self._condition:
            if self._works():
                self._events.append(event)
            self._condition.notify_all()

    def _works(self) -> bool:
        return bool(self._watchers) and not self._closing

    # ---- in the publisher's thread ---------------------------------------------------------------
    def _run(self) -> None:
        before = sys.getswitchinterval()
        sys.setswitchinterval(min(before, _SWITCH_INTERVAL))
        try:
            self._publish()
        finally:
            sys.setswitchinterval(before)
            with self._condition:
                self._watchers = []  # nobody waits for room that a thread which is gone would make
                self._condition.notify_all()

    def _publish(self) -> None:
        closing = False
        while not closing:
            with self._condition:
                self._condition.wait_for(self._has_news, self._patience())
                closing = self._closing
                views, events = self._take_views(), list(self._events)
                self._events.clear()
                self._condition.notify_all()
            if not self._every_frame:
                self._look_at_map(now=closing)
            for event in events:
                self._tell(methodcaller("on_event", event))
            for changes, view in views:
                if changes:
                    self._tell(methodcaller("on_map", changes))
                self._tell(methodcaller("on_frame", view))
        if self._every_frame:
            self._look_at_map(now=True)
        self._tell(methodcaller("close"))

    def _has_news(self) -> bool:
        view_wanted = bool(self._views) and time.perf_counter() >= self._next_view_at
        return self._closing or view_wanted or bool(self._events)

    def _patience(self) -> float | None:
        """Return seconds until the next scheduled work."""
        if not self._watchers:
            return None
        due = self._next_view_at if self._views else math.inf
        if not self._every_frame:
            due = min(due, self._next_look_at)
        if due == math.inf:
            return None
        return max(0.0, due - time.perf_counter())

    def _take_views(self) -> list[tuple[MapChanges | None, FrameView]]:
        now = time.perf_counter()
        if not self._views or (now < self._next_view_at and not self._closing):
            return []
        views = list(self._views)
        self._views.clear()
        self._next_view_at = now + self._frame_period
        return views

    def _look_at_map(self, *, now: bool) -> None:
        begin = time.perf_counter()
        if not self._watchers or (begin < self._next_look_at and not now):
            return
        changes = self._follower.update()
        if changes:
            self._tell(methodcaller("on_map", changes))
        self._look_at_resting_maps(now=now or changes.restarted)
        end = time.perf_counter()
        self._next_look_at = max(begin + self._map_period, end + _REST * (end - begin))

    def _look_at_resting_maps(self, *, now: bool) -> None:
        """Query inactive maps, which change rarely, for example by full bundle adjustment."""
        wanted = any(isinstance(watcher, RestingMapsWatcher) for watcher in self._watchers)
        if not wanted or (time.perf_counter() < self._next_resting_at and not now):
            return
        maps = self._resting.update()
        if maps is not None:
            self._tell(methodcaller("on_resting_maps", maps), RestingMapsWatcher)
        self._next_resting_at = time.perf_counter() + _RESTING_PERIOD

    def _tell(self, news: Callable[[Watcher], None], whom: type = object) -> None:
        for watcher in [watcher for watcher in self._watchers if isinstance(watcher, whom)]:
            try:
                news(watcher)
            except Exception as error:
                self._leave_out(watcher, error)

    def _leave_out(self, watcher: Watcher, error: Exception) -> None:
        _log.warning(
            "%s stopped: %s; the run continues without it", watcher.name, describe_error(error)
        )
        _log.debug("in full:", exc_info=error)
        with self._condition:
            self._watchers.remove(watcher)
            self._condition.notify_all()
        try:
            watcher.close()
        except Exception as second:
            _log.debug("%s could not be closed", watcher.name, exc_info=second)


def _end(thread: threading.Thread, publisher: weakref.ref[Publisher]) -> None:
    alive = publisher()
    if alive is not None:
        alive.close()


def _rate(times: deque[float]) -> float:
    seconds = times[-1] - times[0]
    return (len(times) - 1) / seconds if seconds > 0 else 0.0


def _copied(image: ByteArray, *, rgb: bool) -> ByteArray:
    """Return a copy of an image of one, three or four channels as grey or RGB."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return np.array(image.reshape(image.shape[:2]))
    if channels == 4:
        code = cv2.COLOR_RGBA2RGB if rgb else cv2.COLOR_BGRA2RGB
    elif rgb:
        return np.array(image)
    else:
        code = cv2.COLOR_BGR2RGB
    return np.asarray(cv2.cvtColor(image, code), np.uint8)
