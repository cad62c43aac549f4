# SPDX-License-Identifier: BSD-3-Clause
"""What the two processes tell each other beside frames and changes of the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray
from orbslam2py.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Subject:
    """Whose page it is, and what can be asked of it."""

    fov: float
    """Vertical field of view of the camera [rad]."""
    with_scale: bool
    """The map has a unit of its own (a single camera)."""
    truth: Trajectory | None
    can_hold: bool
    """The run can stand still, and go on image by image."""
    can_stop: bool


@dataclass(frozen=True, eq=False)
class PathNow:
    """The path through the present map."""

    timestamps: FloatArray
    """(n,) seconds."""
    positions: FloatArray
    """(n, 3) relative to the first keyframe of the map."""
    lost: npt.NDArray[np.bool_]
    """(n,) where the position is that of before."""
    seconds: float
    """That it took to tell."""
