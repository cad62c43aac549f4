# SPDX-License-Identifier: BSD-3-Clause
"""Images of any sensor, given to a system."""

from __future__ import annotations

from typing import Any

from orbslam2py import Sensor, System, TrackingRecord
from orbslam2py.datasets import Images


def feed(system: System, shown: Images, seconds: float, **options: Any) -> TrackingRecord:
    """Track images by the call of the system's sensor."""
    if system.sensor is Sensor.STEREO:
        assert shown.right is not None
        return system.track_stereo(shown.image, shown.right, seconds, **options)
    if system.sensor is Sensor.RGBD:
        assert shown.depth is not None
        return system.track_rgbd(shown.image, shown.depth, seconds, **options)
    return system.track_monocular(shown.image, seconds, **options)


def blackened(shown: Images) -> Images:
    """Images of the same kind in which nothing can be seen."""
    right = None if shown.right is None else 0 * shown.right
    depth = None if shown.depth is None else 0 * shown.depth
    return Images(0 * shown.image, right, depth)
