# SPDX-License-Identifier: BSD-3-Clause
"""Data of a frame for viewers: its keypoints, their matches and more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.slam.records import FrameFeatures, TrackingRecord


class Tracker(Protocol):
    """The part of tracking that a watched frame reads."""

    @property
    def local_points(self) -> IntArray: ...  # noqa: D102
    @property
    def start_lines(self) -> FloatArray | None: ...  # noqa: D102


class WatchedFrame:
    """Data for a viewer after every image; copies are made on request.

    Valid only during the call: the next frame changes the same objects.

    Parameters
    ----------
    image : array of uint8, (h, w) or (h, w, 3) or (h, w, 4)
        The image as given by the caller, who may reuse the memory.
    record : TrackingRecord
        The record of tracking.
    frame : orbslam2py._core.TrackedFrame
        Keypoints and their matches.
    inliers : array of bool, (n,), optional
        See `FrameFeatures.inliers`.
    tracking : Tracker
        Tracking after the frame.
    """

    def __init__(
        self,
        image: ByteArray,
        record: TrackingRecord,
        frame: core.TrackedFrame,
        inliers: npt.NDArray[np.bool_] | None,
        tracking: Tracker,
    ) -> None:
        self.image = image
        self.record = record
        self._frame = frame
        self._inliers = inliers
        self._tracking = tracking

    def features(self) -> FrameFeatures:
        """Keypoints and matches."""
        return self.record.features or frame_features(self._frame, self._inliers)

    def kept_pose(self) -> core.TrackedFrame | None:
        """Copy the pose alone, which `core.follow_map` moves with the map; None if there is none.

        The copy remains valid after the call.
        """
        return None if self._frame.T_cw is None else self._frame.pose_alone()

    def pixels(self) -> npt.NDArray[np.float32]:
        """Pixels of the keypoints in the given image, (n, 2)."""
        return pixels_as_given(self._frame.features)

    def local_points(self) -> IntArray:
        """Ids of the points of the local map, (p,)."""
        return self._tracking.local_points

    def start_lines(self) -> FloatArray | None:
        """While a single camera's map begins: pixels in the first view and now, (m, 4)."""
        return self._tracking.start_lines


#: Called after every image, in the thread of the track call.
FrameWatcher = Callable[[WatchedFrame], None]


def accepted_keypoints(frame: core.TrackedFrame) -> npt.NDArray[np.bool_]:
    """Mask of the keypoints with a point that is an inlier, (n,)."""
    accepted: npt.NDArray[np.bool_] = (frame.map_points >= 0) & (frame.outlier == 0)
    return accepted


def pixels_as_given(frame: core.Frame) -> npt.NDArray[np.float32]:
    """Pixels of the keypoints in the given image, not undistorted, (n, 2)."""
    raw = frame.raw_keypoints
    return raw if len(raw) else frame.keypoints


def frame_features(
    frame: core.TrackedFrame, inliers: npt.NDArray[np.bool_] | None = None
) -> FrameFeatures:
    """Copy the keypoints of a frame and their matches.

    Parameters
    ----------
    frame : orbslam2py._core.TrackedFrame
        The frame.
    inliers : array of bool, (n,), optional
        `accepted_keypoints` of the frame before points were created or dropped.
    """
    features = frame.features
    return FrameFeatures(
        keypoints=features.keypoints,
        levels=features.levels,
        depths=features.depth,
        map_point_ids=frame.map_points,
        inliers=accepted_keypoints(frame) if inliers is None else inliers,
        colours=features.colours,
    )
