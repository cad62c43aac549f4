# SPDX-License-Identifier: BSD-3-Clause
"""The transitions of the tracking state: a pure function of state and event.

The table of all transitions is in ``docs/method/tracking.md#state``.
"""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.slam.config import Config
from orbslam2py.slam.records import TrackingState
from orbslam2py.slam.state.loss import (
    LONG_LOST,
    LastKnownPose,
    LostSearch,
    LostTime,
    Unconfirmed,
)
from orbslam2py.slam.state.motion import Motion
from orbslam2py.slam.state.state import SinceKeyframe, State


# ---- events --------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class NotInitialized:
    """The frame cannot begin a map, and there is no map."""


@dataclass(frozen=True, eq=False)
class MapBegun:
    """A map begins with the frame."""

    frame: core.TrackedFrame
    earlier: tuple[core.TrackedFrame, ...] = ()
    """Frames before it, with poses in the new map."""


@dataclass(frozen=True, eq=False)
class Relocalized:
    """A lost camera is found; the next frame has to confirm it."""

    frame: core.TrackedFrame
    n_inliers: int


@dataclass(frozen=True, eq=False)
class Tracked:
    """The frame has an accepted pose, follows the frame before, and confirms it."""

    frame: core.TrackedFrame
    n_inliers: int
    active_map: int


@dataclass(frozen=True, eq=False)
class NotFound:
    """The frame has no accepted pose."""

    timestamp: float


@dataclass(frozen=True)
class KeyframeInserted:
    """A frame became a keyframe."""

    frame_id: int
    keyframe: int


@dataclass(frozen=True)
class SearchForMap:
    """Tracking has been lost so long that another map may begin."""


@dataclass(frozen=True)
class MapDropped:
    """The active map was dropped; others remain."""


@dataclass(frozen=True, eq=False)
class MapLoaded:
    """Tracking begins in loaded maps."""

    maps: frozenset[int]
    initial_pose: core.Pose | None
    spacing: int
    """Fewest frames from one keyframe to the next."""


Event = (
    NotInitialized
    | MapBegun
    | Relocalized
    | Tracked
    | NotFound
    | KeyframeInserted
    | SearchForMap
    | MapDropped
    | MapLoaded
)


# ---- actions -------------------------------------------------------------------------------------
@dataclass(frozen=True)
class RestartInitializer:
    """The initializer forgets its frames."""


@dataclass(frozen=True)
class ActivateMap:
    """The frame was found in an inactive map, which becomes the active one."""

    frame_id: int
    keyframe: int
    """One of that map."""


Action = RestartInitializer | ActivateMap
_NOTHING: tuple[Action, ...] = ()


class Transitions:
    """The transition function with its constants.

    Parameters
    ----------
    config : Config
        Thresholds.
    new_map_after : float or None
        Seconds after which a lost camera may begin another map; None: never.
    """

    def __init__(self, config: Config, *, new_map_after: float | None) -> None:
        self._limits = config.tracking
        self._relocalization = config.relocalization
        self._patience = new_map_after

    def may_begin_map(self, state: State, timestamp: float) -> bool:
        """Whether a frame that was not found may begin another map."""
        return state.is_lost and state.lost_time.is_over(timestamp, self._patience)

    def is_contradicted(self, state: State, frame: core.TrackedFrame) -> bool:
        """Whether a frame with a pose contradicts the relocalized frame right before it."""
        if state.is_lost or state.unconfirmed is None:
            return False
        return not state.unconfirmed.is_confirmed_by(frame, self._relocalization)

    def next_state(self, state: State, event: Event) -> tuple[State, tuple[Action, ...]]:
        """Return the state after an event, and the actions in their order.

        Parameters
        ----------
        state : State
            The state before it.
        event : Event
            The event.
        """
        after, actions = state, _NOTHING
        match event:
            case NotInitialized():
                after = replace(state, phase=TrackingState.NOT_INITIALIZED)
            case MapBegun():
                after = self._begun(state, event)
            case Relocalized():
                after = self._relocalized(state, event)
            case Tracked():
                after, actions = self._tracked(state, event)
            case NotFound():
                after = self._not_found(state, event)
            case KeyframeInserted(frame_id, keyframe):
                since = SinceKeyframe(frame_id, keyframe)
                after = replace(state, reference_keyframe=keyframe, since_keyframe=since)
            case SearchForMap():
                after = replace(state, seeks_map=True)
                actions = _NOTHING if state.seeks_map else (RestartInitializer(),)
            case MapDropped():
                left = state.in_another_map()
                lost = TrackingState.LOST
                after = replace(left, phase=lost, lost_time=LONG_LOST, seeks_map=True)
            case MapLoaded():
                after = self._loaded(state, event)
        return after, actions

    def _begun(self, state: State, event: MapBegun) -> State:
        frame, earlier = event.frame, event.earlier
        if state.is_lost:
            state = state.in_another_map().map_begun(frame.id)
            state = replace(state, seeks_map=False, lost_time=LostTime())
        motion = state.motion
        if earlier:
            # With these the velocity is known, and the next frame can be predicted.
            motion = motion.remembering(earlier[-1], None).after(frame)
        else:
            motion = motion.remembering(frame, motion.velocity)
        return replace(
            state,
            phase=TrackingState.OK,
            motion=motion,
            reference_keyframe=frame.reference_keyframe,
            since_keyframe=SinceKeyframe(frame.id, frame.reference_keyframe),
        )

    def _relocalized(self, state: State, event: Relocalized) -> State:
        return replace(
            self._with_pose(state, event.frame, event.n_inliers),
            unconfirmed=Unconfirmed.of(event.frame),
            initial_pose=None,
            n_relocalizations=state.n_relocalizations + 1,
        )

    def _tracked(self, state: State, event: Tracked) -> tuple[State, tuple[Action, ...]]:
        frame = event.frame
        actions: list[Action] = []
        if state.seeks_map:
            actions.append(RestartInitializer())
        if frame.map_index != event.active_map:
            actions.append(ActivateMap(frame.id, frame.reference_keyframe))
        after = replace(
            self._with_pose(state, frame, event.n_inliers),
            lost_time=state.lost_time.tracked(frame, self._patience),
            n_lost=0,
            seeks_map=False,
            unconfirmed=None,
            # Outside the map, frames are tracked and relocalized at the same time; that search
            # continues.
            lost=state.lost if state.unconfirmed is None else LostSearch(),
        )
        return after, tuple(actions)

    def _with_pose(self, state: State, frame: core.TrackedFrame, n_inliers: int) -> State:
        return replace(
            state,
            phase=TrackingState.OK,
            motion=state.motion.after(frame),
            is_scarce=n_inliers < self._limits.scarce_inliers,
        )

    def _not_found(self, state: State, event: NotFound) -> State:
        after = replace(
            state,
            phase=TrackingState.LOST,
            lost_time=state.lost_time.lost(event.timestamp),
            n_lost=state.n_lost + 1,
            is_scarce=False,
            beyond_map=False,
            unconfirmed=None,
            keyframe_candidate=None,
        )
        if state.phase is not TrackingState.OK:
            return after
        if state.unconfirmed is None:
            motion = state.motion
            here = LastKnownPose(motion.last, motion.velocity, state.reference_keyframe)
            return replace(
                after,
                motion=motion.lost(),
                lost=LostSearch(here),
            )
        # The relocalized frame was wrong: the search continues where tracking was lost before.
        place = state.lost.place
        if place is None:
            return replace(after, motion=Motion(), reference_keyframe=-1)
        motion = Motion().remembering(place.last, None).lost()
        return replace(after, motion=motion, reference_keyframe=place.reference_keyframe)

    def _loaded(self, state: State, event: MapLoaded) -> State:
        return replace(
            state,
            phase=TrackingState.LOST,
            kept_maps=event.maps,
            # The keyframes are of another run: the first frame that is found may become one.
            since_keyframe=SinceKeyframe(-event.spacing),
            initial_pose=event.initial_pose,
            in_loaded_map=True,
        )
