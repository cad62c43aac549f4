# SPDX-License-Identifier: BSD-3-Clause
"""Loop closing: takes every keyframe that local mapping has finished.

It enters them into the index by which lost frames are found again. Correcting loops is not part of
this version, and `n_loops` stays 0.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py.threads import Worker


class LoopClosing:
    """Third stage of the pipeline: indexes finished keyframes in order.

    Parameters
    ----------
    world : orbslam2py._core.Map
        The map.
    index : orbslam2py._core.KeyFrameIndex
        Which keyframes contain which words.
    threaded : bool
        In a thread of its own, or inline.
    """

    def __init__(self, world: core.Map, index: core.KeyFrameIndex, *, threaded: bool) -> None:
        self._map = world
        self._index = index
        #: Loops closed so far, over all maps.
        self.n_loops = 0
        #: The last keyframe that arrived, -1 before the first.
        self.last_keyframe = -1
        self.worker: Worker[int] = Worker("loop closing", self.process, threaded=threaded)

    def insert_keyframe(self, keyframe: int) -> None:
        """Queue a keyframe."""
        self.worker.submit(keyframe)

    def reset(self) -> None:
        """Drop waiting keyframes."""
        self.worker.reset()
        self.last_keyframe = -1

    def process(self, keyframe: int) -> None:
        """Take note of one keyframe."""
        core.index_keyframe(self._index, self._map, keyframe)
        self.last_keyframe = keyframe
