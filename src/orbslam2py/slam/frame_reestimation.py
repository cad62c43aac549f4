# SPDX-License-Identifier: BSD-3-Clause
"""Past frames, matched again with the present map.

``docs/method/map.md#settled-frames``.
"""

from __future__ import annotations

from dataclasses import replace

from orbslam2py import _core as core
from orbslam2py.slam.pose_search import PoseSearch, RefinedPose
from orbslam2py.slam.records import PoseEstimate
from orbslam2py.slam.state import State

#: Times that a frame whose pose is in doubt is matched, at most: each is nearer to where it was.
_MOST_LOOKS = 6

#: Inliers that each of them must bring, by those before. In images that show little, one look leads
#: to the next one with as many wrong matches, further and further away.
_MORE_INLIERS = 1.1


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

    def __call__(
        self, frame: core.TrackedFrame, *, in_doubt: bool = False, finished: bool = True
    ) -> core.TrackedFrame:
        """Return a copy of a frame with its pose in the present map.

        A keyframe, or a frame that is not found, keeps the pose that follows its keyframe.

        Parameters
        ----------
        frame : TrackedFrame
            The frame as it was tracked; it is not changed.
        in_doubt : bool
            The pose may be far off: search wide windows, and repeat from the new pose while that
            finds clearly more points.
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
        if not in_doubt and frame.aligned.any() and not frame.features.has_images:
            # Corners alone would give it a worse pose.
            return followed
        refined: RefinedPose | None = None
        for _ in range(_MOST_LOOKS if in_doubt else 1):
            found = followed if refined is None else refined.frame
            looked = self._look(found, wide=in_doubt)
            if looked is None:
                break
            if in_doubt and not _shows_more(looked.frame, found):
                # From where it was, in the local map that the look found.
                refined = refined or replace(looked, frame=found)
                break
            refined = looked
        if refined is None:
            return followed
        if finished:
            refined = self._search.local_map_search.rematch(refined, in_doubt=in_doubt)
        return _without_outliers(refined).frame

    def _look(self, frame: core.TrackedFrame, *, wide: bool) -> RefinedPose | None:
        state = State().relocalized(frame.id) if wide else State()
        refined = self._search.local_map_search.refine(_copy_of(frame), PoseEstimate(), state)
        return _without_outliers(refined) if refined.estimate.found else None


def _shows_more(looked: core.TrackedFrame, found: core.TrackedFrame) -> bool:
    return looked.n_associated() >= _MORE_INLIERS * found.n_associated()


def _without_outliers(refined: RefinedPose) -> RefinedPose:
    refined.frame.discard_outliers()
    return refined


def _copy_of(frame: core.TrackedFrame) -> core.TrackedFrame:
    copy = core.TrackedFrame(frame.features)
    copy.take_over(frame)
    core.discard_temporary(copy)  # seen by the frame before alone
    return copy
