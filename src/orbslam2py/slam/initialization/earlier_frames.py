# SPDX-License-Identifier: BSD-3-Clause
"""Tracks the frames before a single camera's map began in this map.

``docs/method/start.md#earlier-frames``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.slam.acceptance.pose_acceptance import PoseAcceptance
from orbslam2py.slam.pose_search import PoseSearch
from orbslam2py.slam.records import PoseEstimate, TrackingState, Verdict
from orbslam2py.slam.state import Motion, State

_PATIENCE = 5  # frames that may be missing between those that are found
_MOST_DEVIATION = math.radians(1.0)  # standard deviation of a rotation, all directions together


class EarlierFrames:
    """Tracks frames from the first keyframe on, forwards and backwards.

    Parameters
    ----------
    search : PoseSearch
        Estimates poses; not shared with the tracker.
    acceptance : PoseAcceptance
        Validates poses; of the same search.
    """

    def __init__(self, search: PoseSearch, acceptance: PoseAcceptance) -> None:
        self._search = search
        self._acceptance = acceptance
        self._tracked: tuple[core.TrackedFrame, ...] = ()

    def take(self) -> tuple[core.TrackedFrame, ...]:
        """Return the tracked frames in the order of time, once."""
        tracked, self._tracked = self._tracked, ()
        return tracked

    def track(
        self, history: list[core.TrackedFrame], first: core.TrackedFrame
    ) -> list[core.TrackedFrame]:
        """Estimate poses of the frames of a history before its last one.

        Parameters
        ----------
        history : list of TrackedFrame
            In the order of time; the last frame has begun the map.
        first : TrackedFrame
            The first view, which is in the history and has a pose.

        Returns
        -------
        list of TrackedFrame
            The frames with poses between the first view and the last frame, in the order of time.
        """
        at = next(i for i, frame in enumerate(history) if frame.id == first.id)
        before = self._follow(first, reversed(history[:at]))
        between = self._follow(first, history[at + 1 : -1])
        self._tracked = (*reversed(before), first, *between)
        return between

    def _follow(
        self, first: core.TrackedFrame, frames: Iterable[core.TrackedFrame]
    ) -> list[core.TrackedFrame]:
        """Track frames in this order, until several in a row have no pose."""
        state = State(
            phase=TrackingState.OK,
            motion=Motion().remembering(first, None),
            reference_keyframe=first.reference_keyframe,
        )
        tracked: list[core.TrackedFrame] = []
        missed = 0
        for frame in frames:
            is_found, state = self._find(frame, state)
            if is_found:
                tracked.append(frame)
                missed = 0
                continue
            missed += 1
            if missed > _PATIENCE:
                break
            state = replace(state, motion=state.motion.lost())
            frame.clear_associations()
            frame.T_cw = None
        return tracked

    def _find(self, frame: core.TrackedFrame, state: State) -> tuple[bool, State]:
        search = self._search
        state = state.following(search.map)
        estimate = search.by_motion_model(frame, state)
        if not estimate.found:
            frame.clear_associations()
            estimate = search.by_keyframes(frame, state)
        estimate, state = self._acceptance.refine(frame, estimate, state)
        if not (estimate.found and _is_strong(estimate) and _is_exact(estimate)):
            return False, state
        frame.discard_outliers()
        # Not `Motion.after`: the numbers of the frames may fall.
        velocity = core.velocity_between(state.motion.last, frame)
        return True, replace(state, motion=state.motion.remembering(frame, velocity))


def _is_strong(estimate: PoseEstimate) -> bool:
    """Return whether the evidence suffices for a past frame; a frame left out costs little.

    Confirmation by a second method does not suffice. At the border of a map of two views, all
    methods can be wrong together.
    """
    return estimate.evidence is not None and estimate.evidence.verdict is Verdict.STRONG


def _is_exact(estimate: PoseEstimate) -> bool:
    """Return whether a pose is certain enough for a trajectory without covariances."""
    covariance = estimate.covariance
    if covariance is None:
        return False
    return float(covariance[0, 0] + covariance[1, 1] + covariance[2, 2]) <= _MOST_DEVIATION**2
