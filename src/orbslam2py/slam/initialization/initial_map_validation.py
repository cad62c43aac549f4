# SPDX-License-Identifier: BSD-3-Clause
"""Whether the views since a single camera's map began contradict it.

``docs/method/start.md#the-first-frames-of-a-map``.
"""

from __future__ import annotations

import math

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization.initial_views import InitialViews
from orbslam2py.slam.initialization.multi_view_model_selection import MultiViewModelSelection
from orbslam2py.slam.initialization.third_view import (
    Candidate,
    ThirdViews,
    reconstruct,
    three_view_consistency,
)

_AGREEMENTS, _CONTRADICTIONS = 2, 3  # motions until a map is accepted, or dropped
_CONTRADICTED_MAPS = 3  # dropped in a row, after which the next one is not compared


class InitialMapValidation:
    """Finds the motion between views of a young map once more, without the map, and compares.

    What a map begins with may be wrong, or be bent by the first adjustments, and yet explain its
    own frames: their poses and the points are fitted to each other. Matches between the images
    know nothing of the points.

    Parameters
    ----------
    limits : InitializationConfig
        Limits.
    seed : int
        Of the draws.
    """

    def __init__(self, limits: InitializationConfig, seed: int) -> None:
        self._limits = limits
        self._seed = seed
        self._kept = InitialViews(limits)
        self.reset()

    def reset(self) -> None:
        """Watch no longer, and forget what became of the maps before."""
        # Maps in a row that came to nothing by this; where all do, the watch must be what is wrong.
        self._n_contradicted = 0
        self.end()

    def begin(self, frame: core.TrackedFrame) -> None:
        """Watch the map that has begun with a frame, unless all before were contradicted."""
        self.end()
        if self._n_contradicted == _CONTRADICTED_MAPS:
            self._n_contradicted = 0
            return
        self._watching = True
        self._map_index = frame.map_index
        self._follow(frame)
        self._kept.keep_last()

    def end(self) -> None:
        """Watch no longer."""
        self._watching = False
        self._map_index = -1
        self._n_frames = self._n_agreeing = self._n_contradicting = 0
        self._poses: dict[int, core.Pose] = {}
        self._kept.clear()

    @property
    def watching(self) -> bool:
        """Whether the next frame may contradict the map."""
        return self._watching

    def contradicted(self, frame: core.TrackedFrame) -> bool:
        """Compare a frame that was tracked in the map; whether the map must be wrong by now.

        Parameters
        ----------
        frame
            With its pose.
        """
        if self._watching and frame.map_index != self._map_index:
            self.end()
        if not self._watching:
            return False
        self._follow(frame)
        self._compare(frame)
        self._kept.keep_last()
        limits = self._limits
        self._n_frames += 1
        contradicted = self._n_contradicting >= _CONTRADICTIONS
        if contradicted:
            self._n_contradicted += 1
        elif self._n_agreeing >= _AGREEMENTS or self._n_frames >= limits.watched_frames:
            self._n_contradicted = 0
        else:
            return False
        self.end()
        return contradicted

    def _follow(self, frame: core.TrackedFrame) -> None:
        assert frame.T_cw is not None
        self._kept.follow(frame.features)
        self._poses[frame.id] = frame.T_cw

    def _compare(self, frame: core.TrackedFrame) -> None:
        apart = self._degrees_apart(frame)
        if apart is None:
            return
        self._n_contradicting += apart > self._limits.contradicting_direction
        self._n_agreeing += apart < self._limits.agreeing_direction

    def _degrees_apart(self, frame: core.TrackedFrame) -> float | None:
        """Between the ways that map and images say it went; None if the images do not say."""
        limits = self._limits
        view = max(self._kept.views, key=lambda view: view.displacement, default=None)
        if view is None or view.displacement < limits.displacement:
            return None
        assert frame.T_cw is not None
        by_map = (frame.T_cw @ self._poses[view.frame.id].inverse()).translation
        if not by_map.any():
            return None
        last = frame.features
        candidate = Candidate.of(view, reconstruct(view, last, self._seed))
        if candidate is None:
            return None
        thirds = ThirdViews.of(candidate, self._kept, limits)
        motions = three_view_consistency(candidate, thirds, last, limits)
        if len(motions) != 1:
            return None
        apart = _degrees_between(by_map, motions[0].T_21.translation)
        if apart < limits.agreeing_direction:
            return apart
        # To speak against a map takes more than a draw that a third view agrees with.
        together = MultiViewModelSelection(candidate, thirds, last, limits)
        best = together.best_motion(motions, self._seed)
        return None if best is None else _degrees_between(by_map, best.T_21.translation)


def _degrees_between(way: FloatArray, other: FloatArray) -> float:
    lengths = float(np.linalg.norm(way) * np.linalg.norm(other))
    return math.degrees(math.acos(np.clip(way @ other / lengths, -1.0, 1.0)))
