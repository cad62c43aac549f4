# SPDX-License-Identifier: BSD-3-Clause
"""The innovation: from a pose to the one that was predicted."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbslam2py.slam.state import Motion
from support.tracking_scene import FakeFrame, pose


def test_the_change_is_from_the_pose_to_where_the_motion_led() -> None:
    motion: Any = Motion()
    frames = [FakeFrame(i) for i in range(3)]
    for frame, x in zip(frames, (0.0, 1.0, 1.5), strict=True):
        frame.T_cw = pose(x)
    assert motion.innovation(frames[0]) is None
    for frame in frames[:2]:
        motion = motion.after(frame)
    np.testing.assert_allclose(motion.innovation(frames[2]), [0, 0, 0, 0.5, 0, 0])
