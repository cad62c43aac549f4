# SPDX-License-Identifier: BSD-3-Clause
"""A car with a stereo pair whose yaw begins from one image to the next."""

from __future__ import annotations

import math

import numpy as np

from orbslam2py import TrackingRecord
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import Images
from orbslam2py.settings import Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

#: Middle of the street at the left of the block, and where its corner is [m].
_STREET_X, _CORNER_Z = -52.0, 104.0


class SharpCorner:
    """Straight ahead, then around a corner to the right at full rate, then straight on.

    Parameters
    ----------
    seed
        Of the pictures on the walls.
    degrees
        By which the car turns from one image to the next, beginning at once.
    before, after
        Images on the straight legs.
    """

    def __init__(
        self, seed: int = 0, degrees: float = 4.0, before: int = 20, after: int = 6
    ) -> None:
        options = SyntheticOptions(
            world="street-lap", sensor="stereo", seed=seed, size=(620, 188), noise=1.0
        )
        self._sequence = SyntheticSequence(options)
        curvature = math.radians(degrees)  # a metre from image to image
        n_turning = round(90 / degrees)
        x, z, heading = _STREET_X, _CORNER_Z - 1 / curvature - before, 0.0
        poses = []
        for i in range(before + n_turning + after):
            poses.append(_pose(x, z, heading))
            turn = curvature if before <= i < before + n_turning else 0.0
            # The chord of the arc.
            x += math.sin(heading + turn / 2)
            z += math.cos(heading + turn / 2)
            heading += turn
        self.T_wc = np.stack(poses)

    def __len__(self) -> int:
        return len(self.T_wc)

    @property
    def settings(self) -> Settings:
        return self._sequence.settings

    def load(self, index: int) -> Images:
        return self._sequence.view(self.T_wc[index], index)

    def errors(self, records: list[TrackingRecord]) -> list[tuple[float, float]]:
        """Metres and degrees by which each motion from image to image is wrong; nan without."""
        errors = []
        for i in range(1, len(records)):
            T_before, T_after = records[i - 1].T_wc, records[i].T_wc
            if T_before is None or T_after is None:
                errors.append((math.nan, math.nan))
                continue
            true = np.linalg.inv(self.T_wc[i - 1]) @ self.T_wc[i]
            wrong = np.linalg.inv(true) @ np.linalg.inv(T_before) @ T_after
            cosine = np.clip((np.trace(wrong[:3, :3]) - 1) / 2, -1, 1)
            errors.append((float(np.linalg.norm(wrong[:3, 3])), math.degrees(math.acos(cosine))))
        return errors


def _pose(x: float, z: float, heading: float) -> FloatArray:
    T_wc = np.eye(4)
    T_wc[0, [0, 2]] = math.cos(heading), math.sin(heading)
    T_wc[2, [0, 2]] = -math.sin(heading), math.cos(heading)
    T_wc[[0, 2], 3] = x, z
    return T_wc
