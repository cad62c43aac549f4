# SPDX-License-Identifier: BSD-3-Clause
"""Compares an IMU with the path of the camera: axes, signs, units, clock, gravity."""

from orbslam2py.inertial.check.check import check_imu
from orbslam2py.inertial.check.plot import draw_imu_check
from orbslam2py.inertial.check.report import Finding, ImuReport

__all__ = ["Finding", "ImuReport", "check_imu", "draw_imu_check"]
