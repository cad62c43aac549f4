# SPDX-License-Identifier: BSD-3-Clause
"""The viewer: the growing map of a running system, or that of a finished run."""

from orbslam2py.viewer.live import LiveView, Viewer
from orbslam2py.viewer.publisher import Publisher
from orbslam2py.viewer.resting_maps import RestingMaps, RestingMapsWatcher
from orbslam2py.viewer.watching import FrameView, QueueState, Watcher

__all__ = [
    "FrameView",
    "LiveView",
    "Publisher",
    "QueueState",
    "RestingMaps",
    "RestingMapsWatcher",
    "Viewer",
    "Watcher",
]
