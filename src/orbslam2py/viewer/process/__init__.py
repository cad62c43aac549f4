# SPDX-License-Identifier: BSD-3-Clause
"""The live page in a separate process: tracking shares no interpreter with the drawing."""

from orbslam2py.viewer.process.companion import Companion, CompanionError

__all__ = ["Companion", "CompanionError"]
