# SPDX-License-Identifier: BSD-3-Clause
"""Readers of calibration files, one function for each format of `orbslam2py.calibration.formats`.

Each takes an `orbslam2py.calibration.foreign_cameras.CalibrationSource` and returns an
`orbslam2py.calibration.foreign_cameras.CameraFile`.
"""
