# SPDX-License-Identifier: BSD-3-Clause
"""The section ``inertial`` of the configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class InertialConfig:
    """Use of an IMU in tracking."""

    longest: float = 5.0
    """Longest time for which the IMU predicts poses without an image, s."""
    beyond: float = 0.5
    """Images with enough features without a match in the map for this time show a new place: the
    map is extended there (with depth) or another one is searched (one camera), s."""
    map_walk: float = 2e-3
    """Random walk of the axes of a growing map, rad / sqrt(s), and of the logarithm of the scale of
    one camera's map, 1 / sqrt(s). Without it the drift of the map would be taken for bias."""

    #: The IMU starts if the direction of gravity [rad] and the logarithm of one camera's scale are
    #: known to these standard deviations ...
    gravity_known: ClassVar[float] = 0.03
    scale_known: ClassVar[float] = 0.03
    #: ... and if the weighted squared residual per degree of freedom is smaller than this.
    misfit: ClassVar[float] = 3.0
    #: The errors of map points are common to images within this time [s]: together these count as
    #: one measurement.
    common: ClassVar[float] = 0.5
    #: Factor on the noise of the IMU in bundle adjustment of one camera's map, whose scale it
    #: holds. With depth the drift of the map is added to the noise instead.
    noise_factor: ClassVar[float] = 8.0
