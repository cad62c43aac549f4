# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU, and their check against the path of the camera."""

from orbslam2py.inertial.samples import (
    ImuSamples,
    clean_rows,
    imu_rows,
    joined_streams,
    make_samples,
)

__all__ = ["ImuSamples", "clean_rows", "imu_rows", "joined_streams", "make_samples"]
