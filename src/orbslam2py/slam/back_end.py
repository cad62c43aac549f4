# SPDX-License-Identifier: BSD-3-Clause
"""The map and its workers: local mapping, loop closing, full bundle adjustment."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from orbslam2py import _core as core
from orbslam2py._cores import n_threads
from orbslam2py._worker import Worker, take_turns
from orbslam2py.errors import MapFileError, WorkerError
from orbslam2py.maps.map_autosave import MapAutosave
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import Config
from orbslam2py.slam.events import (
    Callbacks,
    EventDispatcher,
    KeyframeAdded,
    LoopClosed,
    MapChangeCause,
    MapChanged,
    MapsMerged,
)
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord, FullBundleAdjustment
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.loop_closing import LoopClosing
from orbslam2py.slam.options import SystemOptions

_log = logging.getLogger(__name__)

#: Seconds that a reset waits for a worker before it names the late one.
RESET_PATIENCE = 60.0


class BackEnd:
    """All parts behind tracking, from their start to their end.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    options : SystemOptions
        Options of the system.
    config : Config
        Thresholds.
    callbacks : Callbacks
        Receives events.
    """

    def __init__(
        self, sensor: Sensor, options: SystemOptions, config: Config, callbacks: Callbacks
    ) -> None:
        threaded = not options.deterministic
        self.map = core.Map()
        alignment = config.alignment.for_sensor(sensor)
        self.keyframe_index = core.KeyFrameIndex()
        self.events = EventDispatcher(callbacks, threaded=threaded)
        # The other core processes images during mapping, unless the images wait for mapping.
        images_wait = not threaded or (options.wait_for_mapping and not sensor.has_depth)
        self.mapping = LocalMapping(
            self.map,
            sensor,
            self.keyframe_index,
            config.mapping,
            threaded=threaded,
            adjustment_threads=n_threads(2) if images_wait else 1,
            alignment=alignment,
        )
        self.adjustment = FullBundleAdjustment(
            self.map,
            self.mapping.worker,
            time_limit=options.full_adjustment_time_limit,
            monocular=not sensor.has_depth,
            threaded=threaded,
            on_done=partial(_announce_adjustment, self.events),
        )
        self.loop_closing = LoopClosing(
            self.map,
            self.keyframe_index,
            sensor,
            self.mapping.worker,
            self.adjustment,
            options,
            on_loop=partial(_announce, self.events, MapChangeCause.LOOP),
            on_merge=partial(_announce, self.events, MapChangeCause.MERGE),
            config=config,
        )
        self.mapping.on_done = partial(_pass_on_keyframe, self.map, self.loop_closing, self.events)
        take_turns(self.workers)

    @property
    def map_workers(self) -> tuple[Worker[int], ...]:
        """The workers that change the map, in the order in which they pass keyframes on."""
        return self.mapping.worker, self.loop_closing.worker, self.adjustment.worker

    @property
    def workers(self) -> tuple[Worker[Any], ...]:
        """The workers that change the map, and the one that delivers events."""
        return (*self.map_workers, self.events.worker)

    def reset(self, timeout: float, *, keep: Callable[[], None]) -> None:
        """Drop the map and all work that is queued for it.

        Parameters
        ----------
        timeout : float
            Seconds to wait for each worker; then an error is raised.
        keep : callable
            Called after all workers have stopped, before the map is dropped.

        Raises
        ------
        WorkerError
            If a worker does not end its step in time; the message names it.
        """
        for worker in self.map_workers:
            worker.reset(timeout)
        self.mapping.reset()
        self.loop_closing.reset()
        keep()
        ended = self.map.active_map
        self.keyframe_index.clear()
        self.map.clear()
        self.events.post(MapChanged(ended, MapChangeCause.RESET))

    def drop_map(self, map_index: int, timeout: float, *, keep: Callable[[int], None]) -> bool:
        """Drop only the active map; the youngest of the others becomes active.

        Parameters
        ----------
        map_index : int
            Its number. If it has been merged into another map since, nothing is dropped.
        timeout : float
            Seconds to wait for each worker.
        keep : callable
            Called with the number of the map after its workers have stopped, before it is dropped.

        Returns
        -------
        bool
            Whether it was dropped.

        Raises
        ------
        WorkerError
            If a worker does not end its step in time; the message names it, and the map is
            unchanged.
        """
        # Only tracking, which waits here, gives them work. No keyframe that waits may die.
        for worker in (self.mapping.worker, self.loop_closing.worker):
            if not worker.wait_until_idle(timeout):
                raise WorkerError(f"{worker.name} did not end its work within {timeout} s")
        if self.map.active_map != map_index:
            return False
        with self.adjustment.kept_away():
            keep(map_index)
            for keyframe in self.map.erase_map(map_index).tolist():
                self.keyframe_index.erase(keyframe)
        self.events.post(MapChanged(map_index, MapChangeCause.RESET))
        return True

    def wait_until_idle(self, timeout: float | None, *, close_loop: bool = False) -> bool:
        """Wait until every worker is idle.

        Parameters
        ----------
        timeout : float or None
            Seconds; None: for ever.
        close_loop : bool
            If a loop waits for a better one, close it, and wait for the work that follows.

        Returns
        -------
        bool
            False if the time is over first, or if a worker holds work back during a long pause.
        """
        deadline = None if timeout is None else time.monotonic() + timeout

        def are_idle() -> bool:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            workers = self.map_workers
            return all(worker.wait_until_idle(left, unless_held=True) for worker in workers)

        if not are_idle():
            return False
        if not (close_loop and self.loop_closing.has_loop_waiting):
            return True
        self.loop_closing.end()
        return are_idle()

    def finish(
        self, *, drain: bool, wait_for_adjustment: bool, timeout: float | None
    ) -> list[Exception]:
        """End the workers; return their errors."""
        errors: list[Exception] = []
        for worker in self.workers:
            wait = drain and (wait_for_adjustment or worker is not self.adjustment.worker)
            try:
                if wait and worker is self.loop_closing.worker:
                    with contextlib.suppress(WorkerError):  # reported at the end
                        self.loop_closing.end()
                worker.finish(drain=wait, timeout=timeout)
            except Exception as error:
                errors.append(error)
        return errors

    def statistics(self) -> dict[str, dict[str, float]]:
        """Median, mean and p99 milliseconds per stage."""
        return {
            **self.mapping.statistics.summary(),
            **self.loop_closing.statistics.summary(),
            **self.adjustment.statistics.summary(),
        }


def abandon(back_end: BackEnd, keeper: MapAutosave) -> None:
    """End the threads of a system that was dropped without shutdown."""
    if keeper.is_saving_here:
        # What drops things that refer to each other runs in any thread, and this one cannot wait
        # for its own end.
        threading.Thread(target=abandon, args=(back_end, keeper), name="abandon").start()
        return
    try:
        keeper.stop_autosave()
    except MapFileError as unsaved:
        _log.error("while a system was dropped: %s", unsaved)
    for error in back_end.finish(drain=False, wait_for_adjustment=False, timeout=RESET_PATIENCE):
        _log.error("while a system was dropped", exc_info=error)


# The workers' threads must not hold the system that owns them, or it would never be dropped: these
# functions know the parts that they need and no more.


def _pass_on_keyframe(
    slam_map: core.Map, loop_closing: LoopClosing, events: EventDispatcher, keyframe: int
) -> None:
    if events.wanted(KeyframeAdded):
        added = KeyframeAdded(
            map_index=slam_map.map_of(keyframe),
            keyframe=keyframe,
            timestamp=slam_map.keyframe_timestamp(keyframe),
            T_wc=slam_map.keyframe_pose(keyframe).inverse().matrix,
            n_keyframes=slam_map.n_keyframes,
            n_map_points=slam_map.n_points,
        )
        events.post(added)
    loop_closing.insert_keyframe(keyframe)


def _announce(
    events: EventDispatcher, cause: MapChangeCause, event: LoopClosed | MapsMerged
) -> None:
    events.post(event)
    events.post(MapChanged(event.map_index, cause))


def _announce_adjustment(events: EventDispatcher, record: FullAdjustmentRecord) -> None:
    if record.used:
        events.post(MapChanged(record.map_index, MapChangeCause.FULL_ADJUSTMENT))
