# SPDX-License-Identifier: BSD-3-Clause
"""A map from one frame of a sensor that sees depth.

Mur-Artal and Tardos, 2017, section III-B; ``docs/method/start.md#depth-sensors``.
"""

from __future__ import annotations

import logging
import sys

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization.initializer import Initializer
from orbslam2py.slam.local_mapping import LocalMapping
from orbslam2py.slam.records import Reason

_MOST = 0.5  # share of the settings' features that is asked for at most
_log = logging.getLogger(__name__)


class DepthInitializer(Initializer):
    """Begins a map from one frame of a sensor that sees depth (ORB-SLAM2, section III-B).

    The camera's frame becomes the world's frame.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    vocabulary : orbslam2py._core.Vocabulary
        Describes the first keyframe.
    mapping : LocalMapping
        Takes it.
    n_features : int
        Number of features extracted per image: with few, fewer keypoints are sufficient.
    config : InitializationConfig
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary,
        mapping: LocalMapping,
        n_features: int,
        config: InitializationConfig,
    ) -> None:
        self._map = slam_map
        self._vocabulary = vocabulary
        self._mapping = mapping
        self._limits = limits = config
        self._least = min(limits.keypoints_with_depth_sensor, int(_MOST * n_features))

    def shows_enough(self, frame: core.TrackedFrame) -> bool:
        """Return whether a frame has enough keypoints to begin a map."""
        return frame.features.size > self._least

    def try_initialize(self, frame: core.TrackedFrame, T_cw: core.Pose | None = None) -> Reason:
        """Make the frame the first keyframe, with points from its depths; or return a reason."""
        if not self.shows_enough(frame):
            return Reason.TOO_FEW_KEYPOINTS
        if int(np.count_nonzero(frame.features.depth > 0)) < self._limits.depths:
            return Reason.TOO_FEW_DEPTHS
        # It may have been searched in other maps before.
        frame.take_over(core.TrackedFrame(frame.features))
        self._map.begin_map()
        frame.T_cw = T_cw or core.Pose()
        core.describe(frame.features, self._vocabulary)
        keyframe = core.insert_keyframe(self._map, frame, create_points=True, n_minimum=sys.maxsize)
        self._mapping.insert_keyframe(keyframe)
        n_points = self._map.n_points_of(self._map.active_map)
        _log.info("new map with %d points", n_points)
        return Reason.NONE
