# SPDX-License-Identifier: BSD-3-Clause
"""The live page in a process of its own: tracking shares no interpreter with who draws."""

from orbslam2py.viewer.process.companion import Companion, CompanionError

__all__ = ["Companion", "CompanionError"]
