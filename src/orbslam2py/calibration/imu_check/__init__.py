# SPDX-License-Identifier: BSD-3-Clause
"""Compares an IMU with the path of the camera: axes, signs, units, clock, gravity."""
