# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py``."""

from orbslam2py.cli.app import main

__all__ = ["main"]
