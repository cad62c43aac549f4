# SPDX-License-Identifier: BSD-3-Clause
"""Worlds with z up, as an IMU makes them, beside worlds with the axes of a camera.

Pictures and viewers draw in the axes of a camera: x right, y down, z forward.
"""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray

#: From a world with z up to the axes of a level camera that looks along y.
T_LEVEL = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
#: Below this horizontal part of its viewing direction, a camera looks up or down.
_LEAST_FORWARD = 0.2


def level_frame(T_wc: FloatArray) -> FloatArray:
    """Return the transform from a world with z up to the level axes at a camera.

    Parameters
    ----------
    T_wc
        The camera (4, 4): its position is the origin, its viewing direction gives the forward axis.

    Returns
    -------
    array (4, 4)
        To right, down, forward. Where the camera looks up or down, the top or the bottom of its
        image is forward.
    """
    forward = T_wc[:3, 2]
    if np.hypot(*forward[:2]) < _LEAST_FORWARD:
        forward = np.sign(forward[2]) * T_wc[:3, 1]
    angle = np.arctan2(forward[0], forward[1])
    c, s = float(np.cos(angle)), float(np.sin(angle))
    T = np.eye(4)
    T[:3, :3] = T_LEVEL[:3, :3] @ [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    T[:3, 3] = -T[:3, :3] @ T_wc[:3, 3]
    return T


def moved(T: FloatArray, positions: FloatArray) -> FloatArray:
    """Apply a transform (4, 4) to positions (..., 3)."""
    return np.asarray(positions @ T[:3, :3].T + T[:3, 3])
