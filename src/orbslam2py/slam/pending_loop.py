# SPDX-License-Identifier: BSD-3-Clause
"""A loop with few matches waits for a better one; ``docs/method/loops.md#waiting``."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from orbslam2py import _core as core
from orbslam2py.slam.config import LoopConfig

_PATIENCE = 8  # keyframes that a loop with few matches waits for a better one


class PendingLoop:
    """Chooses the loop with most matches among those of a few keyframes.

    From a distance, the points of a place lie close together in the image, and a few wrong matches
    rotate the similarity by degrees. The keyframes that follow see more of it.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    verify : callable
        ``verify(current, matched)``: the loop between two keyframes, or None.
    release : callable
        ``release(keyframe)`` ends the lease of a keyframe.
    config : LoopConfig
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        verify: Callable[[int, int], core.Loop | None],
        release: Callable[[int], None],
        config: LoopConfig,
    ) -> None:
        self._map = slam_map
        self._verify = verify
        self._release = release
        self._limits = config
        self._best: core.Loop | None = None
        self._n_waited = 0
        self._big_change = 0

    @property
    def has_loop(self) -> bool:
        """Whether one waits."""
        return self._best is not None

    def drop(self) -> None:
        """Give up what waits."""
        best, self._best = self._best, None
        if best is not None:
            self._release(best.current)

    @contextlib.contextmanager
    def ripe(self, found: core.Loop | None) -> Iterator[core.Loop | None]:
        """Yield the loop to close now, if there is one; called once for a keyframe.

        Parameters
        ----------
        found : Loop or None
            The loop of this keyframe, or None.
        """
        self._follow_map()
        self._consider(found)
        if not self._is_ripe():
            yield None
            return
        with self.last() as best:
            yield best

    @contextlib.contextmanager
    def last(self) -> Iterator[core.Loop | None]:
        """Yield the pending loop, if there is one: no keyframe follows."""
        self._follow_map()
        try:
            yield self._best
        finally:
            self.drop()

    def _consider(self, found: core.Loop | None) -> None:
        best = self._best
        if best is not None:
            self._n_waited += 1
            if found is None or found.n_matches <= best.n_matches:
                return
            self.drop()
        elif found is None:
            return
        else:
            self._n_waited = 0
        self._map.begin_lease(found.current)
        self._best = found
        self._big_change = self._map.big_change_index

    def _is_ripe(self) -> bool:
        best = self._best
        if best is None:
            return False
        return best.n_matches >= self._limits.firm_matches or self._n_waited >= _PATIENCE

    def _follow_map(self) -> None:
        """Verify the pending loop again if the map has moved; drop it if it fails."""
        best = self._best
        if best is None:
            return
        alive = all(self._map.has_keyframe(k) for k in (best.current, best.matched))
        if alive and self._map.big_change_index == self._big_change:
            return
        self._big_change = self._map.big_change_index
        found = self._verify(best.current, best.matched) if alive else None
        if found is None:
            self.drop()
        else:
            self._best = found
