# SPDX-License-Identifier: BSD-3-Clause
"""The section ``inertial`` of the configuration."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class InertialConfig:
    """Use of an IMU in tracking."""

    longest: float = 5.0
    """The IMU leads through images without a pose for this time, s."""
    beyond: float = 0.5
    """Images with enough features without a match in the map for this time show a new place: the
    map is extended there (with depth) or another one is searched (one camera), s."""
    gravity_known: float = 0.03
    """The IMU starts if the direction of gravity is known to this standard deviation, rad."""
    scale_known: float = 0.03
    """The same for the logarithm of the scale of one camera's map."""
    misfit: float = 3.0
    """Largest weighted squared residual per degree of freedom with which the IMU starts."""
    map_walk: float = 2e-3
    """Random walk of the axes of a growing map, rad / sqrt(s), and of the logarithm of the scale of
    one camera's map, 1 / sqrt(s). Without it the drift of the map would be taken for bias."""
    common: float = 0.5
    """The errors of map points are common to images within this time: together these count as one
    measurement, s."""
    noise_factor: float = 2.0
    """Factor on the noise of the IMU in bundle adjustment of one camera's map: it holds the scale.
    With depth the drift of the map is added to the noise instead."""
