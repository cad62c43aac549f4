# SPDX-License-Identifier: BSD-3-Clause
"""What those who watch a running system are given: plain data, theirs to keep."""

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
    """How the stream of images is keeping up."""

    n_frames: int = 0
    """Images tracked since the publisher began."""
    n_not_shown: int = 0
    """Of these, passed over because the rate is limited or a watcher was slow."""
    n_dropped: int = 0
    """Images that were never tracked: they were overtaken by the next one."""
    frames_per_second: float = 0.0
    """Images tracked, over the last second or so."""
    latency: str = ""
    """Time from exposure to pose of a live image lately, by stage; empty if it is not known."""


@dataclass(frozen=True, eq=False)
class FrameView:
    """One image, and what tracking made of it."""

    image: ByteArray
    """(h, w) grey, or (h, w, 3) RGB."""
    record: TrackingRecord
    """Pose, state, reason, milliseconds per stage."""
    earlier: tuple[TrackingRecord, ...]
    """Records of the images since the last view, which were not shown; oldest first."""
    features: FrameFeatures
    """Keypoints and what they are matched with; coordinates are undistorted."""
    pixels: npt.NDArray[np.float32]
    """(n, 2) where the keypoints lie in `image`."""
    visual_odometry: npt.NDArray[np.bool_]
    """(n,) keypoints that the pose hangs on and that are no points of the map."""
    local_points: IntArray
    """(p,) ids of the points of the local map."""
    start_lines: FloatArray | None
    """While a single camera's map begins: (m, 4) pixels x, y in the first view and x, y now."""
    localization: bool
    """The map stays as it is."""
    queue: QueueState

    @property
    def matched(self) -> npt.NDArray[np.bool_]:
        """(n,) keypoints that the pose hangs on and that are points of the map."""
        matched: npt.NDArray[np.bool_] = self.features.inliers & ~self.visual_odometry
        return matched


@runtime_checkable
class Watcher(Protocol):
    """Somebody who looks on: a viewer, a recording, a video.

    All is called in the publisher's thread, one after the other. Who raises is left out from then
    on, with one warning; the system goes on.
    """

    @property
    def name(self) -> str:
        """What warnings call it: "the viewer"."""
        ...

    def on_frame(self, view: FrameView) -> None:
        """An image has been tracked."""
        ...

    def on_map(self, changes: MapChanges) -> None:
        """The map is another one than at the last call."""
        ...

    def on_event(self, event: Event) -> None:
        """Something has happened: see `orbslam2py.Callbacks`."""
        ...

    def close(self) -> None:
        """Nothing more will come; called once."""
        ...
