# SPDX-License-Identifier: BSD-3-Clause
"""Effect of an IMU on synthetic sequences: ``python -m benchmarks.inertial``."""
