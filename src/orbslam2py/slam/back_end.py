# SPDX-License-Identifier: BSD-3-Clause
"""The map and the workers that tend it: local mapping, loop closing, full bundle adjustment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from orbslam2py import _core as core
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.events import (
    Callbacks,
    EventDispatcher,
    KeyframeAdded,
    LoopClosed,
    MapChangeCause,
    MapChanged,
)
from orbslam2py.slam.full_bundle_adjustment import (
    FullAdjustment,
    FullAdjustmentOptions,
    FullAdjustmentRecord,
)
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.loop_closing import LoopClosing
from orbslam2py.slam.worker import Worker


class BackEnd:
    """Everything behind tracking, and its life cycle.

    Parameters
    ----------
    sensor : Sensor
        What the images come from.
    loop_closing : bool
        Whether loops are closed.
    adjustment : FullAdjustmentOptions
        About the full bundle adjustment after a loop.
    callbacks : Callbacks
        Who wants to know what happens.
    seed : int
        Seed of all random draws.
    threaded : bool
        Workers in threads of their own, or inline.
    """

    def __init__(
        self,
        sensor: Sensor,
        *,
        loop_closing: bool,
        adjustment: FullAdjustmentOptions,
        callbacks: Callbacks,
        seed: int,
        threaded: bool,
    ) -> None:
        self.map = core.Map()
        self.index = core.KeyFrameIndex()
        self.events = EventDispatcher(callbacks, threaded=threaded)
        self.mapping = LocalMapping(self.map, sensor, self.index, threaded=threaded)
        self.adjustment = FullAdjustment(
            self.map,
            self.mapping.worker,
            adjustment,
            monocular=not sensor.has_depth,
            threaded=threaded,
            on_done=_announce_adjustment(self.events),
        )
        self.loop_closing = LoopClosing(
            self.map,
            self.index,
            sensor,
            self.mapping.worker,
            self.adjustment,
            enabled=loop_closing,
            seed=seed,
            threaded=threaded,
            on_loop=_announce_loop(self.events),
        )
        self.mapping.on_done = _pass_on_keyframe(self.map, self.loop_closing, self.events)

    @property
    def map_workers(self) -> tuple[Worker[int], ...]:
        """Those that change the map, in the order in which they hand work on."""
        return self.mapping.worker, self.loop_closing.worker, self.adjustment.worker

    @property
    def workers(self) -> tuple[Worker[Any], ...]:
        """All."""
        return (*self.map_workers, self.events.worker)

    def reset(self, timeout: float, *, keep: Callable[[], None]) -> None:
        """Drop the map, and all work on it.

        Parameters
        ----------
        timeout : float
            Seconds to wait for each worker before it is an error.
        keep : callable
            Called when nobody works on the map any more, before it is dropped.

        Raises
        ------
        WorkerError
            Naming the worker that did not end its step in time.
        """
        for worker in self.map_workers:
            worker.reset(timeout)
        self.mapping.reset()
        self.loop_closing.reset()
        keep()
        self.index.clear()
        self.map.clear()
        ended = self.loop_closing.map_index
        self.loop_closing.map_index = self.adjustment.map_index = ended + 1
        change = MapChanged(ended, MapChangeCause.RESET)
        self.events.post(self.events.callbacks.on_map_change, change)

    def wait_until_idle(self, timeout: float | None) -> bool:
        """Wait until every worker is idle.

        False when one took longer than `timeout` seconds, or holds work back for a pause that may
        last.
        """
        return all(worker.wait_until_idle(timeout, unless_held=True) for worker in self.map_workers)

    def finish(
        self, *, drain: bool, wait_for_adjustment: bool, timeout: float | None
    ) -> list[Exception]:
        """End the workers; returns what went wrong."""
        errors: list[Exception] = []
        for worker in self.workers:
            wait = drain and (wait_for_adjustment or worker is not self.adjustment.worker)
            try:
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


# The workers' threads must not hold the system that owns them, or it would never be dropped: these
# functions know the parts that they need and no more.


def _pass_on_keyframe(
    world: core.Map, loop_closing: LoopClosing, events: EventDispatcher
) -> Callable[[int], None]:
    def pass_on(keyframe: int) -> None:
        callback = events.callbacks.on_keyframe
        if callback is not None:
            added = KeyframeAdded(
                map_index=loop_closing.map_index,
                keyframe=keyframe,
                timestamp=world.keyframe_timestamp(keyframe),
                T_wc=world.keyframe_pose(keyframe).inverse().matrix,
                n_keyframes=world.n_keyframes,
                n_map_points=world.n_points,
            )
            events.post(callback, added)
        loop_closing.insert_keyframe(keyframe)

    return pass_on


def _announce_loop(events: EventDispatcher) -> Callable[[LoopClosed], None]:
    def announce(closed: LoopClosed) -> None:
        events.post(events.callbacks.on_loop, closed)
        change = MapChanged(closed.map_index, MapChangeCause.LOOP)
        events.post(events.callbacks.on_map_change, change)

    return announce


def _announce_adjustment(events: EventDispatcher) -> Callable[[FullAdjustmentRecord], None]:
    def announce(record: FullAdjustmentRecord) -> None:
        if record.used:
            change = MapChanged(record.map_index, MapChangeCause.FULL_ADJUSTMENT)
            events.post(events.callbacks.on_map_change, change)

    return announce
