# SPDX-License-Identifier: BSD-3-Clause
"""Past frames, matched again with the present map.

``docs/method/map.md#settled-frames``.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py.slam.pose_search import PoseSearch
from orbslam2py.slam.records import PoseEstimate
from orbslam2py.slam.state import State


class FrameReestimation:
    """Estimates new poses of past frames; it only reads the map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    search : PoseSearch
        Estimates poses; not shared with the tracker.
    """

    def __init__(self, slam_map: core.Map, search: PoseSearch) -> None:
        self._map = slam_map
        self._search = search

    def __call__(self, frame: core.TrackedFrame, *, finished: bool = True) -> core.TrackedFrame:
        """Return a copy of a frame with its pose in the present map.

        A keyframe, or a frame that is not found, keeps the pose that follows its keyframe.

        Parameters
        ----------
        frame : TrackedFrame
            The frame as it was tracked; it is not changed.
        finished : bool
            The frame is not matched again: the result must not depend on the tracked pose.
        """
        followed = _copy_of(frame)
        if followed.T_cw is None:
            return followed
        core.follow_map(self._map, followed)
        keyframe = self._map.living(followed.reference_keyframe)
        if keyframe >= 0 and self._map.frame_of(keyframe) == frame.id:
            return followed
        if frame.aligned.any() and not frame.features.has_images:
            # Corners alone would give it a worse pose.
            return followed
        search = self._search.local_map_search
        refined = search.refine(_copy_of(followed), PoseEstimate(), State())
        if not refined.estimate.found:
            return followed
        refined.frame.discard_outliers()
        if finished:
            refined = search.rematch(refined, in_doubt=False)
            refined.frame.discard_outliers()
        return refined.frame


def _copy_of(frame: core.TrackedFrame) -> core.TrackedFrame:
    copy = core.TrackedFrame(frame.features)
    copy.take_over(frame)
    core.discard_temporary(copy)  # seen by the frame before alone
    return copy
