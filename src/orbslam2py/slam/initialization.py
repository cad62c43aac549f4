# SPDX-License-Identifier: BSD-3-Clause
"""How a map begins."""

from __future__ import annotations

import logging
import sys

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.records import Reason

_log = logging.getLogger(__name__)

#: A frame must have more keypoints than this to begin a map ...
_MIN_KEYPOINTS = 500
#: ... and at least this many with depth, or the map would be lost at once.
_MIN_DEPTHS = 100


class DepthInitializer:
    """Begins a map from one frame of a sensor that sees depth (ORB-SLAM2, section III-B).

    The camera's frame becomes the world's frame.
    """

    def __init__(self, world: core.Map, vocabulary: core.Vocabulary, mapping: LocalMapping) -> None:
        self._map = world
        self._vocabulary = vocabulary
        self._mapping = mapping

    def reset(self) -> None:
        """Nothing is kept from frame to frame."""

    def try_initialize(self, frame: core.TrackedFrame) -> Reason:
        """Make the frame keyframe 0, with a map point for every depth; or say why not."""
        if frame.frame.size <= _MIN_KEYPOINTS:
            return Reason.TOO_FEW_KEYPOINTS
        if int(np.count_nonzero(frame.frame.depth > 0)) < _MIN_DEPTHS:
            return Reason.TOO_FEW_DEPTHS
        frame.T_cw = core.Pose()
        core.describe(frame.frame, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=True, n_minimum=sys.maxsize)
        self._mapping.insert_keyframe(keyframe)
        _log.info("new map with %d points", self._map.n_points)
        return Reason.NONE
