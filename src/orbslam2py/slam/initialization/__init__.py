# SPDX-License-Identifier: BSD-3-Clause
"""How a map begins: from one frame with depths, or from two views of a single camera.

Mur-Artal, Montiel and Tardos, 2015, section IV; Mur-Artal and Tardos, 2017, section III-B;
``docs/method/start.md``.
"""

from orbslam2py.slam.initialization.from_depth import DepthInitializer
from orbslam2py.slam.initialization.from_views import MonocularInitializer
from orbslam2py.slam.initialization.initializer import Initializer

__all__ = ["DepthInitializer", "Initializer", "MonocularInitializer"]
