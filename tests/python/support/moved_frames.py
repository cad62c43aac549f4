# SPDX-License-Identifier: BSD-3-Clause
"""A second look at frames that sees all of them elsewhere."""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py.slam.frame_reestimation import FrameReestimation


class MovedByAMetre(FrameReestimation):
    """Finds every frame a metre ahead, and remembers which were asked for."""

    def __init__(self) -> None:
        self.seen: list[int] = []
        self.finished: list[bool] = []

    def __call__(self, frame: core.TrackedFrame, *, finished: bool = True) -> core.TrackedFrame:
        self.seen.append(frame.id)
        self.finished.append(finished)
        assert frame.T_cw is not None
        moved = core.TrackedFrame(frame.features)
        moved.T_cw = core.Pose(np.array([0.0, 0, 0, 1]), np.array([0, 0, -1.0])) @ frame.T_cw
        moved.share_anchor(frame)
        return moved
