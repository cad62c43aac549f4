# SPDX-License-Identifier: BSD-3-Clause
"""A map from two views of a single camera, confirmed by a third view.

Mur-Artal, Montiel and Tardos, 2015, section IV; ``docs/method/start.md#one-camera``.
"""

from __future__ import annotations

import logging
from collections import deque

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization.earlier_frames import EarlierFrames
from orbslam2py.slam.initialization.initial_views import InitialViews, View
from orbslam2py.slam.initialization.initializer import Initializer
from orbslam2py.slam.initialization.multi_view_model_selection import MultiViewModelSelection
from orbslam2py.slam.initialization.third_view import (
    Candidate,
    Motion,
    ThirdViews,
    placed_matches,
    reconstruct,
    three_view_consistency,
)
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.records import Reason
from orbslam2py.slam.watched_frame import pixels_as_given

_log = logging.getLogger(__name__)

_TRIED_VIEWS = 3  # that are reconstructed with each frame: some milliseconds each
_PATIENCE, _PATIENCE_SECONDS = 10, 1.0  # frames, or time [s], until there are still more features
_REMEMBERED_FRAMES = 200  # that are tracked in a new map after it began: ten seconds at 20 a second
_FOLLOWED_AGAIN = 20  # of them, that begin the next map after one was dropped

#: Outcomes of the reconstruction from two views, as reasons of a record.
_REASONS = {
    "too_few_matches": Reason.FEW_MATCHES_FIRST_VIEW,
    "degenerate_points": Reason.DEGENERATE_VIEWS,
    "no_model": Reason.DEGENERATE_VIEWS,
    "degenerate_plane": Reason.DEGENERATE_VIEWS,
    "too_few_points": Reason.DEGENERATE_VIEWS,
    "low_parallax": Reason.LOW_PARALLAX,
    "ambiguous_motion": Reason.AMBIGUOUS_MOTION,
}


class MonocularInitializer(Initializer):
    """Keeps recent views and begins a map from the one that fits the last frame best.

    The frame of that view becomes the world's frame; its median depth becomes 1. A third view
    must agree. The frames before and between are then tracked in the map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Describes the first keyframes.
    mapping : LocalMapping
        Takes the first keyframes.
    seed : int
        Seed of the draws.
    earlier : EarlierFrames
        Tracks the earlier frames in the map.
    config : InitializationConfig
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        seed: int,
        earlier: EarlierFrames,
        *,
        config: InitializationConfig,
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._seed = seed
        self._limits = config
        self._kept = InitialViews(self._limits)
        self._earlier = earlier
        # The last map's number, and the keyframes between the two that it began from.
        self._begun_map = -1
        self._between: list[int] = []
        self.reset()

    def reset(self) -> None:
        """Drop all views."""
        self._kept.clear()
        self._history: deque[core.TrackedFrame] = deque(maxlen=_REMEMBERED_FRAMES)
        self._n_waiting = 0
        self._waited = self._waits_since = 0.0  # seconds
        self._last: core.TrackedFrame | None = None
        self._shown: View | None = None

    def remember(self, frame: core.TrackedFrame) -> None:
        """Keep a frame that was tracked in a young map, in case this map is dropped."""
        self._history.append(frame)

    def remembered(self) -> list[core.Frame]:
        """The frames from before and after a map began."""
        return [frame.features for frame in self._history]

    def restart(self, frames: list[core.Frame]) -> None:
        """Start again, with the recent views of an earlier attempt."""
        self.reset()
        # Their poses were those in the map that is gone.
        self._history.extend(core.TrackedFrame(frame) for frame in frames)
        for frame in frames[-_FOLLOWED_AGAIN:]:
            if frame.size <= self._limits.keypoints:
                continue
            self._kept.follow(frame)
            self._kept.keep_last()

    def n_between(self) -> int:
        """Living keyframes of the start of the active map, beyond the two that a map needs."""
        if self._map.active_map != self._begun_map:
            return 0
        return sum(self._map.living(keyframe) == keyframe for keyframe in self._between)

    @property
    def feature_factor(self) -> int:
        """Return twice the features of the settings, and more if the start takes long."""
        limits = self._limits
        waited = self._n_waiting >= _PATIENCE or self._waited >= _PATIENCE_SECONDS
        return limits.raised_feature_factor if waited else limits.feature_factor

    def lines(self) -> FloatArray | None:
        """Return pixels of the first view and of their matches in the last frame, (m, 4)."""
        if self._shown is None or self._last is None:
            return np.zeros((0, 4))
        matched = np.flatnonzero(self._shown.matches >= 0)
        seen_first = pixels_as_given(self._shown.frame)[matched]
        seen_last = pixels_as_given(self._last.features)[self._shown.matches[matched]]
        return np.hstack([seen_first, seen_last]).astype(np.float64)

    def take_earlier(self) -> tuple[core.TrackedFrame, ...]:
        """Return the frames before the one that began the map, with poses in it, in order; once."""
        return self._earlier.take()

    def shows_enough(self, frame: core.TrackedFrame) -> bool:
        """Return whether a frame has enough keypoints to begin a map."""
        return frame.features.size > self._limits.keypoints

    def try_initialize(self, frame: core.TrackedFrame, T_cw: core.Pose | None = None) -> Reason:
        """Begin the map with this frame as second view; or return the reason why not."""
        if self._n_waiting == 0:
            self._waits_since = frame.timestamp
        self._n_waiting += 1
        self._waited = frame.timestamp - self._waits_since
        if not self.shows_enough(frame):
            self._kept.clear()
            self._last = self._shown = None
            return Reason.TOO_FEW_KEYPOINTS
        had_views = bool(self._kept.views)
        self._kept.follow(frame.features)
        self._history.append(frame)
        self._last = frame
        reason = self._from_best_pair(frame)
        if reason is Reason.NONE:
            return reason
        self._shown = self._kept.views[0] if self._kept.views else None
        self._kept.keep_last()
        if self._shown is None:
            return Reason.FEW_MATCHES_FIRST_VIEW if had_views else Reason.FIRST_VIEW
        return reason

    def _from_best_pair(self, frame: core.TrackedFrame) -> Reason:
        """Try all views with this frame, those with the largest motion first."""
        reason = Reason.LOW_PARALLAX
        candidates: list[Candidate] = []
        for view in self._tried_views():
            result = reconstruct(view, frame.features, self._seed)
            candidate = Candidate.of(view, result)
            if candidate is not None:
                candidates.append(candidate)
            if not result.success and reason is Reason.LOW_PARALLAX:
                reason = _REASONS[result.outcome.name]
        for candidate in sorted(candidates, key=lambda candidate: -candidate.worth):
            thirds = ThirdViews.of(candidate, self._kept, self._limits)
            motions = three_view_consistency(candidate, thirds, frame.features, self._limits)
            if not motions:
                reason = Reason.NO_THIRD_VIEW if candidate.is_clear else reason
                continue
            if not self._limits.compare_views:
                return self._build_map(candidate.view, motions[0], frame)
            together = MultiViewModelSelection(candidate, thirds, frame.features, self._limits)
            best = together.best_motion(motions, self._seed)
            if best is None:
                reason = Reason.AMBIGUOUS_MOTION
                continue
            return self._build_map(candidate.view, best, frame)
        return reason

    def _tried_views(self) -> list[View]:
        """Return a few of the views that have moved enough, from the largest motion on."""
        limits = self._limits
        moved = [view for view in self._kept.views if view.displacement >= limits.displacement]
        moved.sort(key=lambda view: -view.displacement)
        places = np.linspace(0, len(moved) - 1, min(_TRIED_VIEWS, len(moved)))
        return [moved[place] for place in np.rint(places).astype(int)]

    # ---- the map ---------------------------------------------------------------------------------
    def _build_map(self, view: View, motion: Motion, second: core.TrackedFrame) -> Reason:
        history = list(self._history)
        first = next((f for f in history if f.id == view.frame.id), None)
        if first is None:
            # A camera that stands still keeps a view for longer than frames are remembered.
            first = core.TrackedFrame(view.frame)
            history.insert(0, first)
        core.describe(first.features, self._vocabulary)
        core.describe(second.features, self._vocabulary)
        self._map.begin_map()
        begun = core.create_monocular_map(
            self._map, first, second, motion.T_21, placed_matches(view, motion), motion.points
        )
        if not begun.ok:
            return Reason.INITIAL_MAP_FAILED
        n_points = self._map.n_points_of(self._map.active_map)
        _log.info("new map with %d points", n_points)
        self._mapping.insert_keyframe(begun.first)
        self._mapping.insert_keyframe(begun.second)
        between = self._earlier.track(history, first)
        self._insert_views([frame for frame in between if self._adds(frame, n_points)])
        self._kept.clear()
        self._n_waiting, self._waited = 0, 0.0
        self._last = self._shown = None
        return Reason.NONE

    def _adds(self, frame: core.TrackedFrame, n_points: int) -> bool:
        """Return whether a kept view between the two contradicts the points."""
        kept = any(view.frame.id == frame.id for view in self._kept.views)
        return kept and frame.n_associated() < self._limits.view_between * n_points

    def _insert_views(self, frames: list[core.TrackedFrame]) -> None:
        """Make keyframes of views between the two that began the map.

        All views have chosen the motion; with two alone, bundle adjustment would change it again.
        """
        self._begun_map, self._between = self._map.active_map, []
        for frame in frames:
            core.describe(frame.features, self._vocabulary)
            keyframe = core.insert_keyframe(self._map, frame, create_points=False)
            self._mapping.insert_keyframe(keyframe)
            self._between.append(keyframe)
