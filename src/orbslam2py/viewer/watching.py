# SPDX-License-Identifier: BSD-3-Clause
"""The data for watchers of a running system: plain copies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.maps.changes import MapChanges
from orbslam2py.slam.events import Event
from orbslam2py.slam.records import FrameFeatures, TrackingRecord


@dataclass(frozen=True)
class QueueState:
    """Speed of the stream of images."""

    n_frames: int = 0
    """Number of images tracked since the publisher began."""
    n_not_shown: int = 0
    """Number of these that were skipped because the rate is limited or a watcher was slow."""
    n_dropped: int = 0
    """Number of images that were never tracked, because the next one came first."""
    frames_per_second: float = 0.0
    """Images tracked, over the last second or so."""
    latency: str = ""
    """Time from exposure to pose of a live image lately, by stage; empty if it is not known."""


@dataclass(frozen=True, eq=False)
class FrameView:
    """One image, and the result of tracking."""

    image: ByteArray
    """(h, w) grey, or (h, w, 3) RGB."""
    record: TrackingRecord
    """Pose, state, reason, milliseconds per stage."""
    earlier: tuple[TrackingRecord, ...]
    """Records of the images since the last view that were skipped; oldest first."""
    features: FrameFeatures
    """Keypoints and their matches; coordinates are undistorted."""
    pixels: npt.NDArray[np.float32]
    """(n, 2) pixels of the keypoints in `image`."""
    visual_odometry: npt.NDArray[np.bool_]
    """(n,) keypoints that are inliers of the pose, but have no map point."""
    local_points: IntArray
    """(p,) ids of the points of the local map."""
    start_lines: FloatArray | None
    """While a single camera's map begins: (m, 4) pixels x, y in the first view and in this
    image."""
    localization: bool
    """Localization mode: the map is fixed."""
    queue: QueueState

    @property
    def matched(self) -> npt.NDArray[np.bool_]:
        """(n,) keypoints that are inliers of the pose and have a map point."""
        matched: npt.NDArray[np.bool_] = self.features.inliers & ~self.visual_odometry
        return matched


@runtime_checkable
class Watcher(Protocol):
    """A watcher: a viewer, a recording, a video.

    All methods are called in the publisher's thread, one after the other. A watcher that raises is
    removed, with one warning; the system continues.
    """

    @property
    def name(self) -> str:
        """Its name in warnings: "the viewer"."""
        ...

    def on_frame(self, view: FrameView) -> None:
        """Called after an image was tracked."""
        ...

    def on_map(self, changes: MapChanges) -> None:
        """Called after the map has changed."""
        ...

    def on_event(self, event: Event) -> None:
        """Called after an event: see `orbslam2py.Callbacks`."""
        ...

    def close(self) -> None:
        """Called once at the end."""
        ...
