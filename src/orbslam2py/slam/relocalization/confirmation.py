# SPDX-License-Identifier: BSD-3-Clause
"""A pose that was found again is believed when the next frame follows from it."""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import IntArray
from orbslam2py.slam.config import RelocalizationConfig


class Confirmation:
    """Keeps a pose found again apart until the next frame has confirmed it.

    Parameters
    ----------
    config : RelocalizationConfig
        Limits.
    """

    def __init__(self, config: RelocalizationConfig) -> None:
        self._limits = config
        self._waiting: tuple[core.Pose, IntArray] | None = None

    @property
    def waiting(self) -> bool:
        """Whether the last pose still has to be confirmed."""
        return self._waiting is not None

    def reset(self) -> None:
        """Nothing is waited for."""
        self._waiting = None

    def found(self, frame: core.TrackedFrame) -> None:
        """Take a frame in which the camera was found again."""
        assert frame.T_cw is not None
        self._waiting = (frame.T_cw, _points_of(frame))

    def follows(self, frame: core.TrackedFrame) -> bool:
        """Whether a tracked frame sees the same things from nearly the same direction.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame after the one found, with pose and associations.
        """
        if self._waiting is None:
            return True
        T_fw, points = self._waiting
        assert frame.T_cw is not None
        common = np.intersect1d(points, _points_of(frame), assume_unique=True)
        turned = (frame.T_cw @ T_fw.inverse()).matrix[:3, :3]
        cosine = (np.trace(turned) - 1) / 2
        limits = self._limits
        return len(common) >= limits.common_points and cosine >= limits.confirming_cosine


def _points_of(frame: core.TrackedFrame) -> IntArray:
    """Ids of the map points that the pose was accepted with, ascending."""
    ids: IntArray = frame.map_points
    return np.unique(ids[(ids >= 0) & (frame.outlier == 0)])
