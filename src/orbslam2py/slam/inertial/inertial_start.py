# SPDX-License-Identifier: BSD-3-Clause
"""The start of an IMU in a map: gravity, scale, biases and velocity from views and samples.

``docs/method/inertial.md#start``.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.inertial.inertial_views import InertialViews
from orbslam2py.slam.inertial_config import InertialConfig

_log = logging.getLogger(__name__)

_LEAST_VIEWS = 8
_LEAST_SECONDS = 1.2
#: Difference [m/s^2] of gravity's length from 9.81 that is allowed where it is estimated.
_GRAVITY_OFF = 1.5
#: Factor on the stated deviations of views, and their least rotation [rad].
_VIEW_FACTOR, _LEAST_TURN = 1.5, 2e-3
#: Deviations of a bias before anything is known: gyro [rad/s], accelerometer [m/s^2].
FIRST_BIAS = (0.1, 0.2)


@dataclass(frozen=True, eq=False)
class KnownBefore:
    """Prior knowledge about an IMU and a map before the IMU starts."""

    bias: FloatArray
    """(6,) gyro [rad/s], accelerometer [m/s^2]."""
    bias_deviations: tuple[float, float]
    """Of gyro and accelerometer."""
    gravity: float = 0.0
    """Deviation [rad] of the third axis from the vertical; 0: not known."""
    scale: float = 0.0
    """Deviation of the logarithm of the scale; 0: not known."""


def with_drift(noise: FloatArray, config: InertialConfig) -> FloatArray:
    """Add the drift of a map to the noise of an IMU.

    The axes of the map turn as a random walk: that is as much noise of the gyro, and turns gravity
    (9.81 m/s^2) in motions of about a second.

    Parameters
    ----------
    noise : array of float64, (4,)
        As of `InertialFilter`.
    config : InertialConfig
        Thresholds.
    """
    drift = np.array([config.map_walk, 9.81 * config.map_walk, 0.0, 0.0])
    noisier: FloatArray = np.hypot(noise, drift)
    return noisier


class InertialStarter:
    """Estimates the state of an IMU from views.

    Parameters
    ----------
    T_cb : Pose
        From the IMU to the camera.
    noise : array of float64, (4,)
        As of `InertialFilter`.
    metric : bool
        The unit of the map is the metre: with depth.
    config : InertialConfig
        Thresholds.
    """

    def __init__(
        self, T_cb: core.Pose, noise: FloatArray, *, metric: bool, config: InertialConfig
    ) -> None:
        self._T_cb = T_cb
        self._noise = with_drift(noise, config)
        self._metric = metric
        self._limits = config

    def is_due(self, views: InertialViews) -> bool:
        """Return whether there are enough views."""
        return len(views.views) >= _LEAST_VIEWS and views.seconds >= _LEAST_SECONDS

    def estimate(
        self, views: InertialViews, slam_map: core.Map, known: KnownBefore
    ) -> core.InertialStart | None:
        """Estimate the state at the last view; None if the data do not determine it, or do not fit.

        Parameters
        ----------
        views : InertialViews
            The last poses in the map, with the samples between them.
        slam_map : orbslam2py._core.Map
            The map.
        known : KnownBefore
            The prior knowledge.
        """
        turn, place = np.median([view.deviations for view in views.views], axis=0)
        start = core.estimate_inertial_start(
            [view.timestamp for view in views.views],
            [view.T_wc(slam_map) for view in views.views],
            [view.samples for view in views.views[1:]],
            self._T_cb,
            self._noise,
            metric=self._metric,
            rotation_deviation=max(_LEAST_TURN, _VIEW_FACTOR * turn),
            position_deviation=max(1e-9, _VIEW_FACTOR * place),
            bias=known.bias,
            gyro_deviation=known.bias_deviations[0],
            accel_deviation=known.bias_deviations[1],
            known_gravity=known.gravity,
            known_scale=known.scale,
        )
        if not self._is_determined(start):
            return None
        _log.info(
            "IMU started after %.1f s: gravity to %.2f degrees, scale to %.1f %%",
            views.seconds,
            math.degrees(start.gravity_deviation),
            100 * start.scale_deviation,
        )
        return start

    def covariance(self, start: core.InertialStart, seconds: float) -> FloatArray:
        """Add the drift of the map during the views, which errors of single views do not show.

        Parameters
        ----------
        start : InertialStart
            The estimate.
        seconds : float
            Time from the first view to the last.

        Returns
        -------
        array of float64, (18, 18)
            In the order of `InertialFilter`.
        """
        walk = self._limits.map_walk**2
        widened = np.array(start.covariance)
        for first, last, variance in (
            (9, 12, walk / seconds),
            (15, 17, walk * seconds),
            (17, 18, 0.0 if self._metric else walk * seconds),
        ):
            rows = np.arange(first, last)
            widened[rows, rows] += variance
        return widened

    def _is_determined(self, start: core.InertialStart) -> bool:
        """Whether the data determine gravity and scale, and fit."""
        limits = self._limits
        return bool(
            start.solved
            and start.gravity_deviation < limits.gravity_known
            and start.scale_deviation < limits.scale_known
            and start.cost < limits.misfit * start.freedom
            and abs(start.gravity_length - 9.81) < _GRAVITY_OFF
        )
