# SPDX-License-Identifier: BSD-3-Clause
"""The view direction of a flat drawing of a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray

#: Ratio of vertical to forward motion above which the path is drawn from behind.
_MORE = 2.0


@dataclass(frozen=True)
class View:
    """The axes of the first keyframe in a picture, and their names."""

    right: int
    up: int
    up_sign: float
    right_name: str
    up_name: str

    def flatten(self, positions: FloatArray) -> FloatArray:
        """Return positions (n, 3) to the right and up in the picture, (n, 2)."""
        flat: FloatArray = positions[:, [self.right, self.up]] * np.array([1.0, self.up_sign])
        return flat


FROM_ABOVE = View(0, 2, 1.0, "right", "forward")
FROM_BEHIND = View(0, 1, -1.0, "right", "up")


def choose_view(positions: FloatArray) -> View:
    """Return the view from above, or from behind if the motion is rather vertical."""
    if len(positions) < 2:
        return FROM_ABOVE
    extent = np.ptp(positions, axis=0)
    return FROM_BEHIND if extent[1] > _MORE * extent[2] else FROM_ABOVE
