# SPDX-License-Identifier: BSD-3-Clause
"""Messages of the two processes beside frames and changes of the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray
from orbslam2py.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Subject:
    """Description of the system, and the possible requests."""

    fov: float
    """Vertical field of view of the camera [rad]."""
    with_scale: bool
    """Whether lengths are in the map's own unit and not in metres (single camera without an
    IMU)."""
    truth: Trajectory | None
    can_hold: bool
    """Whether the run can be paused, and continue image by image."""
    can_stop: bool


@dataclass(frozen=True, eq=False)
class PathNow:
    """The trajectory in the present map."""

    timestamps: FloatArray
    """(n,) seconds."""
    positions: FloatArray
    """(n, 3) relative to the first keyframe of the map; of an upright map, in its drawn world."""
    in_world: bool
    """Whether they are in the drawn world."""
    lost: npt.NDArray[np.bool_]
    """(n,) whether the position repeats the one before."""
    seconds: float
    """Time needed to send it."""
