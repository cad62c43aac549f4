# SPDX-License-Identifier: BSD-3-Clause
"""The check of `orbslam2py.inertial.check`, under its earlier name."""

from orbslam2py.inertial.check import Finding, ImuReport, check_imu, draw_imu_check

__all__ = ["Finding", "ImuReport", "check_imu", "draw_imu_check"]
