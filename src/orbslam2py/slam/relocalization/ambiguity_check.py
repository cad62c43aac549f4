# SPDX-License-Identifier: BSD-3-Clause
"""Check whether a relocalized frame would also fit at another place.

``docs/method/relocalization.md``, "Another place that fits".
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.config import RelocalizationConfig
from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.pnp_verification import Candidate, PnPVerification

_SUPPORT_WINDOW = 5.0  # factor on the search radius: the pose at another place is inexact
_log = logging.getLogger(__name__)


class _Place(NamedTuple):
    """The place of a keyframe at which a frame was found."""

    keyframe: int
    version: core.TrackedFrame
    """The frame, with its pose at this place."""


class AmbiguityCheck:
    """Chooses among the places of one map that a frame fits.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    places : CandidatePlaces
        Gives keyframes that look alike.
    fitting : PnPVerification
        Fits frames to keyframes.
    fix_scale : bool
        Depth is measured: the map has one scale without drift.
    config : RelocalizationConfig
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        places: CandidatePlaces,
        fitting: PnPVerification,
        *,
        fix_scale: bool,
        config: RelocalizationConfig,
    ) -> None:
        self._map = slam_map
        self._places = places
        self._fitting = fitting
        self._fix_scale = fix_scale
        self._limits = config

    def choose(
        self, frame: core.TrackedFrame, keyframe: int, candidates: Sequence[Candidate]
    ) -> core.TrackedFrame | None:
        """Choose the place of a frame that was found at a keyframe.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame, with pose and associations.
        keyframe : int
            The place.
        candidates : sequence of Candidate
            All keyframes that the frame was compared with.

        Returns
        -------
        orbslam2py._core.TrackedFrame or None
            `frame` itself if it fits nowhere else, or far better there; a copy of it at another
            place, if it fits far better there; None if the place is ambiguous.
        """
        there = _Place(keyframe, frame)
        rivals = self._rivals(there, candidates)
        if not rivals:
            return frame
        best = self._best_supported([there, *rivals])
        if best is None:
            _log.info("frame %d looks like several places; none is believed", frame.id)
            return None
        return best.version

    def _rivals(self, there: _Place, candidates: Sequence[Candidate]) -> list[_Place]:
        """Return other places of the same map that the frame fits, and that drift cannot explain.

        The relative pose of other maps is not known.
        """
        slam_map = self._map
        asked = {candidate.keyframe for candidate in candidates}
        alike = [k for k in self._places.alike(there.keyframe) if k not in asked]
        rivals = []
        for candidate in [*candidates, *self._fitting.matched(there.version, alike)]:
            other = candidate.keyframe
            if slam_map.map_of(other) != slam_map.map_of(there.keyframe):
                continue
            if other == there.keyframe or slam_map.weight(other, there.keyframe) > 0:
                continue  # they share points: the same place
            version = core.TrackedFrame(there.version.features)
            if self._fitting.first_that_fits(version, [candidate], self._limits.narrow) is not None:
                rival = _Place(other, version)
                if not self._may_be_one(there, rival):
                    rivals.append(rival)
        return rivals

    def _best_supported(self, places: list[_Place]) -> _Place | None:
        """Return the place whose points the frame shows by far best, if there is one."""
        supports = [self._support(place.version) for place in places]
        best = int(np.argmax(supports))
        most = self._limits.rival_share * supports[best]
        for support, place in zip(supports, places, strict=True):
            if support > most and not self._may_be_one(places[best], place):
                return None
        return places[best]

    def _may_be_one(self, a: _Place, b: _Place) -> bool:
        assert a.version.T_cw is not None and b.version.T_cw is not None
        return a is b or core.may_be_one_place(
            self._map, a.keyframe, a.version.T_cw, b.keyframe, b.version.T_cw, self._fix_scale
        )

    def _support(self, version: core.TrackedFrame) -> int:
        """Return how many points of the local map a frame finds from its pose."""
        seen = core.TrackedFrame(version.features)
        seen.take_over(version)
        local_map = core.select_local_map(self._map, seen)
        nothing = np.zeros(0, np.int64)
        core.match_local_map(seen, local_map.points, nothing, _SUPPORT_WINDOW)
        return int(core.optimize_pose(seen).n_inliers)
