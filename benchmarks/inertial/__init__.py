# SPDX-License-Identifier: BSD-3-Clause
"""What an IMU changes on synthetic sequences: ``python -m benchmarks.inertial``."""
