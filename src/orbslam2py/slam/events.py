# SPDX-License-Identifier: BSD-3-Clause
"""Events of a running system, for callbacks: plain data, delivered in a separate thread.

>>> def closed(event: LoopClosed) -> None:
...     print(f"loop {event.current_keyframe} -> {event.matched_keyframe}")
>>> callbacks = Callbacks(on_loop=closed)
>>> system = System("tum1", "rgbd", callbacks=callbacks)  # doctest: +SKIP
"""

from __future__ import annotations

import enum
import logging
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

from orbslam2py._arguments import shown
from orbslam2py._arrays import EqualByValue, FloatArray
from orbslam2py._worker import Worker
from orbslam2py.errors import SettingsError

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class LoopClosed(EqualByValue):
    """A loop was closed: the camera is at a known place, and the drift was corrected."""

    map_index: int
    """As in `TrackingRecord.map_index`."""
    current_keyframe: int
    matched_keyframe: int
    """The keyframe that showed the place before."""
    current_timestamp: float
    """Seconds."""
    matched_timestamp: float
    n_inliers: int
    """Matches between points of both keyframes that agree with the similarity."""
    n_matches: int
    """Keypoints of the current keyframe that show points around the matched one."""
    n_fused: int
    """Map points that were fused, because both sides of the loop have them."""
    scale: float
    """Factor of the correction on lengths around the current keyframe; 1 with stereo and RGB-D."""
    S_cm: FloatArray
    """(4, 4) similarity: camera of the matched keyframe to camera of the current one."""
    translation: float
    """Translation of the current keyframe by the correction, metres (one camera: the map's
    units)."""
    rotation_deg: float
    """Rotation of the current keyframe by the correction, degrees."""
    milliseconds: dict[str, float] = field(default_factory=dict)
    """Time per step: detect, verify, wait, plan, graph, apply."""


@dataclass(frozen=True, eq=False)
class KeyframeAdded(EqualByValue):
    """Local mapping has finished a new keyframe."""

    map_index: int
    keyframe: int
    timestamp: float
    """Seconds."""
    T_wc: FloatArray
    """(4, 4) camera to world, after mapping."""
    n_keyframes: int
    """In the map."""
    n_map_points: int


@dataclass(frozen=True)
class MapStarted:
    """A map has begun: the first one, one after a reset, or one beside inactive maps."""

    map_index: int
    frame_id: int
    timestamp: float
    """Seconds."""


@dataclass(frozen=True, eq=False)
class MapsMerged(EqualByValue):
    """Two maps showed the same place and were merged, in the world of the older one."""

    map_index: int
    """The older map, which remains."""
    merged_map: int
    """The younger map, which is now part of the older one."""
    current_keyframe: int
    matched_keyframe: int
    """The keyframe of the other map that showed the place before."""
    current_timestamp: float
    """Seconds."""
    matched_timestamp: float
    n_inliers: int
    """Matches between points of both keyframes that agree with the similarity."""
    n_matches: int
    """Keypoints of the current keyframe that show points around the matched one."""
    n_fused: int
    """Map points that were fused, because both maps have them."""
    n_moved_keyframes: int
    n_moved_points: int
    S_km: FloatArray
    """(4, 4) similarity: world of the younger map to that of the older one."""
    scale: float
    """Scale of the similarity, a factor on lengths of the younger map; 1 with stereo and RGB-D."""
    milliseconds: dict[str, float] = field(default_factory=dict)
    """Time per step: detect, verify, wait, plan, apply, weld, graph."""


@dataclass(frozen=True)
class TrackingLost:
    """An image has no pose, but the one before had one."""

    map_index: int
    frame_id: int
    timestamp: float
    reason: str


@dataclass(frozen=True, eq=False)
class Relocalized(EqualByValue):
    """An image has a pose, but the one before had none."""

    map_index: int
    frame_id: int
    timestamp: float
    T_wc: FloatArray
    """(4, 4) camera to world."""


class MapChangeCause(str, enum.Enum):
    """Why the whole map has changed."""

    LOOP = "loop"
    """A loop was closed."""
    FULL_ADJUSTMENT = "full adjustment"
    """All keyframes and points were refined together."""
    MERGE = "merge"
    """Two maps became one."""
    RESET = "reset"
    """The map was dropped; the next one begins."""

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class MapChanged:
    """Poses and points have moved: drawings of them are out of date."""

    map_index: int
    cause: MapChangeCause


@dataclass(frozen=True)
class Callbacks:
    """Functions that receive events.

    They run one after the other in a separate thread (in deterministic mode: in the thread of the
    track call). A slow function therefore delays neither tracking nor mapping. They hold no lock of
    the system and may call its methods. In deterministic mode the image ends only after its
    callbacks. A call that waits for this end (`System.wait_until_idle`, `System.run`) therefore
    raises `StateError` in a callback. An exception in a callback is logged and does not stop the
    system.

    Raises
    ------
    SettingsError
        If one of them is not callable.
    """

    on_loop: Callable[[LoopClosed], None] | None = None
    on_keyframe: Callable[[KeyframeAdded], None] | None = None
    on_lost: Callable[[TrackingLost], None] | None = None
    on_relocalized: Callable[[Relocalized], None] | None = None
    on_map_change: Callable[[MapChanged], None] | None = None
    on_map_started: Callable[[MapStarted], None] | None = None
    on_maps_merged: Callable[[MapsMerged], None] | None = None

    def __post_init__(self) -> None:
        for listener in fields(self):
            function = getattr(self, listener.name)
            if function is not None and not callable(function):
                raise SettingsError(
                    f"{listener.name} is {shown(function)}; give a function that takes the event, "
                    "or None"
                )

    @classmethod
    def of(cls, value: Callbacks | None) -> Callbacks:
        """Take callbacks, or None for no callbacks.

        Raises
        ------
        SettingsError
            For any other object.
        """
        if value is not None and not isinstance(value, Callbacks):
            raise SettingsError(
                f"callbacks is {shown(value)}; give orbslam2py.Callbacks(on_loop=...)"
            )
        return value or cls()


Event = (
    LoopClosed | KeyframeAdded | TrackingLost | Relocalized | MapChanged | MapStarted | MapsMerged
)


class EventDispatcher:
    """Delivers events to the functions of the user, in order.

    Parameters
    ----------
    callbacks : Callbacks
        Receives the events.
    threaded : bool
        Whether to use a separate thread; otherwise inline.
    """

    def __init__(self, callbacks: Callbacks, *, threaded: bool) -> None:
        self._listeners: dict[type, Callable[[Any], None] | None] = {
            LoopClosed: callbacks.on_loop,
            KeyframeAdded: callbacks.on_keyframe,
            TrackingLost: callbacks.on_lost,
            Relocalized: callbacks.on_relocalized,
            MapChanged: callbacks.on_map_change,
            MapStarted: callbacks.on_map_started,
            MapsMerged: callbacks.on_maps_merged,
        }
        self.worker: Worker[Callable[[], None]] = Worker(
            "callbacks", self._deliver, threaded=threaded
        )

        #: Functions that get every event, like the callbacks; assign another tuple to add one.
        self.watchers: tuple[Callable[[Event], None], ...] = ()

    def _deliver(self, deliver: Callable[[], None]) -> None:
        # A function may wait for another thread that calls the system.
        with self.worker.lend_turn():
            deliver()

    def wanted(self, kind: type[Event]) -> bool:
        """Return whether a callback listens to this type of event."""
        return self._listeners[kind] is not None or bool(self.watchers)

    def post(self, event: Event) -> None:
        """Queue an event for the callbacks of its type; nothing if there are none."""
        listener = self._listeners[type(event)]
        listeners = (*(() if listener is None else (listener,)), *self.watchers)
        if not listeners:
            return

        def deliver() -> None:
            for tell in listeners:
                try:
                    tell(event)
                except Exception:
                    _log.exception("a callback failed on %s", type(event).__name__)

        self.worker.offer(deliver)  # a shutdown ends the deliveries
