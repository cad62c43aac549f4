# SPDX-License-Identifier: BSD-3-Clause
"""The IMU beside the camera: its samples by image, and whether it fits the camera."""

from orbslam2py.slam.inertial.imu_buffer import ImuBuffer, ImuInterval
from orbslam2py.slam.inertial.imu_check import ImuCheck, ImuVerdict
from orbslam2py.slam.inertial.inertial_input import InertialInput
from orbslam2py.slam.inertial.inertial_tracker import InertialTracker

__all__ = [
    "ImuBuffer",
    "ImuCheck",
    "ImuInterval",
    "ImuVerdict",
    "InertialInput",
    "InertialTracker",
]
