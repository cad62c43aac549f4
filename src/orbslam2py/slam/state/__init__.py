# SPDX-License-Identifier: BSD-3-Clause
"""The state of tracking: frozen values, and the function that replaces them."""

from orbslam2py.slam.state.loss import (
    COVISIBLE_KEYFRAMES,
    MOTION_FRAMES,
    LastKnownPose,
    LostSearch,
    LostTime,
    Unconfirmed,
)
from orbslam2py.slam.state.motion import Motion
from orbslam2py.slam.state.scene import PoseStatistics, SceneStatistics
from orbslam2py.slam.state.state import SinceKeyframe, State

__all__ = [
    "COVISIBLE_KEYFRAMES",
    "MOTION_FRAMES",
    "LastKnownPose",
    "LostSearch",
    "LostTime",
    "Motion",
    "PoseStatistics",
    "SceneStatistics",
    "SinceKeyframe",
    "State",
    "Unconfirmed",
]
